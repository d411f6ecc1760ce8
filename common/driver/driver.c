// The only main: reads a scene, renders it with the phase that this program is linked to, times
// the frames, writes the picture and the records.
#include "driver/driver.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "timing/timer.h"

#ifdef STEPWISE_COUNT
// Counts operations of the frame with the exact camera. This build's times are not the phase's.
#include "counting/count.h"
#else
#define count_begin() ((void)0)
#define count_end() ((void)0)
#endif

enum { FRAMES_PER_SECOND = 60 };

// Returns the scene's time in seconds at a frame of an animation.
static double time_of(int frame) {
    return (double)frame / FRAMES_PER_SECOND;
}

// Width in bits of the phase's vector instructions, 0 for scalar code.
static int vector_bits(const struct program *program) {
    int lanes = program->variant.lanes;
    int bits = lanes * (strcmp(program->precision, "float") == 0 ? 32 : 64);
    // The lanes may fill several vectors.
#ifdef __aarch64__
    int widest = 128;
#else
    int widest = strstr(program->variant.isa, "avx512") ? 512 : 256;
#endif
    return lanes == 1 ? 0 : bits > widest ? widest : bits;
}

// Turns the camera of every frame but frame 0, by up to four pixels to the right, as the golden ratio
// has it: never twice the same, and at least 1.5 pixels from the frame before. So a phase that keeps
// results of an earlier frame draws a wrong picture (`stepwise judge` looks at its bits).
static struct view displaced(const struct view *exact, int frame, int height) {
    struct view view = *exact;
    double turn = 0.61803398874989485 * frame, pixel = 2 * exact->tan_half_fov / height;
    double angle = 4 * pixel * (turn - floor(turn));
    for (int i = 0; i < 3 && frame != 0; i++) {
        view.forward[i] = cos(angle) * exact->forward[i] + sin(angle) * exact->right[i];
        view.right[i] = cos(angle) * exact->right[i] - sin(angle) * exact->forward[i];
    }
    return view;
}

// Renders one frame and times it. In an animation the time includes phase_update. False: memory is
// short.
static bool timed_frame(struct session *s, const struct view *view, struct measured *m) {
    bool moves = s->scene.model.animated, done = true;
    m->core_before = s->tsc_hz > 0 ? timer_core_hz(s->tsc_hz, 8) : 0;
    m->before = driver_conditions();
    m->ns = timer_ns();
    m->tsc = timer_tsc_begin();
    if (moves) {
        done = phase_update(s->prepared, &s->moving);
        m->update_ns = timer_ns() - m->ns;
    }
    done = done && phase_render(s->prepared, view, &s->frame);
    m->tsc = timer_tsc_end() - m->tsc;
    m->ns = timer_ns() - m->ns;
    m->after = driver_conditions();
    m->core_after = s->tsc_hz > 0 ? timer_core_hz(s->tsc_hz, 8) : 0;
    return done;
}

static bool write_picture(const struct session *s, char *error) {
    const struct options *o = &s->options;
    const uint8_t *shown = s->rgb8 ? s->rgb8 : s->frame.shown;
    if (driver_ends_in(o->out, ".exr"))
        return frame_write_exr(o->samples > 1 ? &s->averaged : &s->frame, o->out, error);
    return (driver_ends_in(o->out, ".png") ? frame_write_png : frame_write_ppm)(
        o->width, o->height, shown, o->out, error);
}

// Gamma and 8 bits, and with --samples the means before it.
static void present(struct session *s) {
    if (s->options.samples > 1)
        frame_average(&s->frame, s->options.samples, &s->averaged);
    frame_present(s->presenter, s->options.samples > 1 ? &s->averaged : &s->frame, s->rgb8);
}

// Renders, times and records frame `index`; negative: warm-up. Returns an exit status.
static int render_frame(struct session *s, int index, bool warmup, bool first) {
    bool plays = s->options.frames > 0, exact = index == s->options.first_frame;
    struct measured m = {.scene_time = plays ? time_of(index) : 0};
    struct view view = displaced(&s->scene.view, index, s->options.height);
    // An animation's camera is on its path: frame k must not depend on the frame that the run starts with.
    if (plays)
        scene_view(&s->scene, m.scene_time, &view); // has a direction: check_flight
    if (s->scene.model.animated)
        model_move(&s->scene.model, m.scene_time, &s->moving);
    if (exact)
        count_begin();
    bool done = timed_frame(s, &view, &m);
    if (exact)
        count_end();
    if (!done)
        return driver_error(NO_MEMORY, "out of memory while rendering");
    if (s->rgb8) {
        m.present_ns = timer_ns();
        present(s);
        m.present_ns = timer_ns() - m.present_ns;
    }
    if (exact && s->options.out) {
        char error[512];
        if (!write_picture(s, error))
            return driver_error(BAD_INPUT, "%s", error);
    }
    json_t *record = driver_record(&m, s, index, warmup, first);
    if (s->options.jsonl) {
        json_t *line = driver_header(s);
        if (!line || !record || json_object_update(line, record) != 0) {
            json_decref(line);
            json_decref(record);
            return driver_error(NO_MEMORY, "out of memory");
        }
        json_decref(record);
        if (!driver_print(line))
            return driver_error(BAD_INPUT, "standard output cannot be written: %s",
                                strerror(errno));
    } else if (s->options.json) {
        if (!record || json_array_append_new(s->frames, record) != 0)
            return driver_error(NO_MEMORY, "out of memory");
    } else {
        json_decref(record);
        const struct options *o = &s->options;
        char of[32] = "";
        if (o->samples > 1)
            snprintf(of, sizeof of, ", %d rays a pixel", o->samples * o->samples);
        printf("%s %s %dx%d%s: %.3f ms, %.1f ns/pixel, %.3g timer cycles at %.3f GHz, core clock "
               "%.2f GHz%s\n",
               phase_built.phase, s->scene.name, o->width, o->height, of, (double)m.ns / 1e6,
               (double)m.ns / ((double)o->width * o->height), (double)m.tsc, s->tsc_hz / 1e9,
               (m.core_before + m.core_after) / 2e9, warmup ? " (warm-up)" : "");
    }
    return OK;
}

// Allocates the frame and the displayed picture; false: memory is short.
static bool allocate_pictures(struct session *s) {
    const struct options *o = &s->options;
    s->presenter = presenter_create(o->threads);
    if (!s->presenter)
        return false;
    if (o->display && phase_built.display && o->samples == 1)
        return frame_create_display(&s->frame, o->width, o->height, s->presenter);
    s->rgb8 = malloc(3 * (size_t)o->width * (size_t)o->height);
    if (!s->rgb8 ||
        (o->samples > 1 && !frame_create(&s->averaged, o->width, o->height, false, NULL)))
        return false;
    return frame_create(&s->frame, o->width * o->samples, o->height * o->samples, o->aov,
                        phase_built.planes);
}

static int run(struct session *s) {
    const struct options *o = &s->options;
    if (!allocate_pictures(s) || !(s->frames = json_array()))
        return driver_error(NO_MEMORY, "out of memory for %d x %d pixels", o->width, o->height);
    s->scene.model.animated = o->frames > 0 && s->scene.model.features.motion;
    if (!model_copy(&s->scene.model, &s->moving))
        return driver_error(NO_MEMORY, "out of memory for %d shapes", s->moving.shape_count);
    // Measuring the clocks takes 25 ms, much longer than a small picture. Tests that want only the
    // picture turn it off; the rates are 0 then.
    bool timed = getenv("STEPWISE_UNTIMED") == NULL;
    int bits = vector_bits(&s->program);
    s->tsc_hz = timed ? timer_tsc_hz(20) : 0;
    s->overhead = timer_overhead_cycles();
    s->core_hz_load = timed && bits ? timer_core_hz_under_load(s->tsc_hz, 8, bits) : 0;
    uint64_t begin = timer_ns();
    s->prepared = phase_prepare(&s->scene.model, s->options.threads);
    s->prepare_ns = timer_ns() - begin;
    if (!s->prepared)
        return driver_error(NO_MEMORY, "out of memory while preparing the scene");
    driver_warn(s);
    int begin_index = o->first_frame - o->warmup, end = o->frames ? o->frames : o->reps;
    for (int i = begin_index; i < end; i++) {
        int status = render_frame(s, i, i < o->first_frame, i == begin_index);
        if (status != OK)
            return status;
    }
    if (o->json) {
        json_t *object = driver_header(s);
        if (!object || json_object_set(object, "frames", s->frames) != 0)
            return driver_error(NO_MEMORY, "out of memory");
#ifdef STEPWISE_COUNT
        json_t *counts = count_result();
        if (!counts || json_object_update(object, counts) != 0)
            return driver_error(NO_MEMORY, "out of memory while counting");
        json_decref(counts);
#endif
        if (!driver_print(object))
            return driver_error(BAD_INPUT, "standard output cannot be written: %s",
                                strerror(errno));
    }
    return driver_flush();
}

// Returns an exit status: BAD_INPUT if the camera has no direction in one of the frames, or if nothing moves.
static int check_flight(const struct session *s) {
    const struct options *o = &s->options;
    struct view view;
    if (o->frames == 0)
        return OK;
    if (!s->scene.model.features.motion && s->scene.flight.path.type == PATH_NONE)
        return driver_error(BAD_INPUT,
                            "%s: --frames: neither the camera nor a shape has a path, so that all "
                            "frames would be one; --reps renders a still picture again",
                            o->scene);
    for (int i = o->first_frame - o->warmup; i < o->frames; i++)
        if (scene_view(&s->scene, time_of(i), &view) != AIM_OK)
            return driver_error(BAD_INPUT,
                                "%s: $.camera.path: at %g s the camera is at look_at or looks "
                                "along up; its path must keep away from both",
                                o->scene, time_of(i));
    return OK;
}

static bool same_file(const char *a, const char *b) {
    struct stat x, y;
    return stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

// Refuses before a long render what cannot be rendered or written. Returns an exit status.
static int check(const struct session *s) {
    const struct options *o = &s->options;
    char error[SCENE_ERROR_SIZE];
    const char *unsupported = groups_unsupported(phase_built.groups, &s->scene);
    if (!unsupported && phase_unsupported)
        unsupported = phase_unsupported(&s->scene);
    if (!unsupported && phase_picture_unsupported)
        unsupported =
            phase_picture_unsupported(&s->scene, o->width * o->samples, o->height * o->samples);
    if (unsupported)
        return driver_error(UNSUPPORTED, "%s: %s", o->scene, unsupported);
    int status = check_flight(s);
    if (status != OK)
        return status;
    if (o->out && same_file(o->out, o->scene))
        return driver_error(BAD_INPUT, "%s: cannot be written: it is the scene, or a link to it",
                            o->out);
    if (o->out && !frame_writable(o->out, error))
        return driver_error(BAD_INPUT, "%s", error);
    return OK;
}

// Phases keep packets on the stack and recurse at mirrors. On a small stack (`ulimit -s`) they would
// crash without a message: opt7_tiles needs more than 320 KiB for 256 bounces between two mirrors.
enum { MIN_STACK = 1 << 20 };

static bool stack_is_small(void) {
    struct rlimit stack;
    return getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur < MIN_STACK;
}

int main(int argc, char **argv) {
    struct session s = {.program = {phase_built.phase, phase_built.flags_from,
                                    phase_built.precision, phase_built.compiler, variant_here()}};
    signal(SIGXFSZ, SIG_IGN); // beyond `ulimit -f` write() fails, and the error can be printed
    int status = driver_parse(argc, argv, &s.options);
    if (status != OK)
        return status < 0 ? driver_flush() : status;
    if (!variant_limit_valid())
        return driver_error(BAD_INPUT, "STEPWISE_ISA_LIMIT is %s: avx2 or none is required",
                            getenv("STEPWISE_ISA_LIMIT"));
    if (stack_is_small())
        return driver_error(BAD_INPUT, "a stack of %d KiB is required: ulimit -s %d or more",
                            MIN_STACK >> 10, MIN_STACK >> 10);
    const char *missing = variant_missing();
    if (missing)
        return driver_error(NO_ISA, "%s needs %s, which this CPU lacks", phase_built.phase,
                            missing);
    if (s.options.threads > 1 && !phase_built.threads)
        return driver_error(UNSUPPORTED, "%s runs on one thread; --threads 1 is all it takes",
                            phase_built.phase);
    char error[SCENE_ERROR_SIZE];
    if (!scene_load(s.options.scene, &s.options.overrides, &s.scene, error))
        return driver_error(BAD_INPUT, "%s", error);
    status = check(&s);
    if (status == OK)
        status = run(&s);
    if (s.prepared)
        phase_release(s.prepared);
    json_decref(s.frames);
    free(s.moving.shapes);
    free(s.rgb8);
    presenter_free(s.presenter);
    frame_free(&s.averaged);
    frame_free(&s.frame);
    scene_free(&s.scene);
    return status;
}
