// The only main: reads a scene, times the phase it is linked to, writes the picture and the record.
#include <errno.h>
#include <getopt.h>
#include <glob.h>
#include <gnu/libc-version.h>
#include <jansson.h>
#include <math.h>
#include <sched.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "phase.h"
#include "phase_info.h"
#include "timer.h"
#include "variant.h"

#ifdef STEPWISE_COUNT
// Counts of the exact picture; its times are those of the counting, not of the phase.
#include "count.h"
#else
#define count_begin() ((void)0)
#define count_end() ((void)0)
#endif

enum status { OK = 0, BAD_INPUT = 2, NO_ISA = 3, UNSUPPORTED = 4, NO_MEMORY = 5 };
enum { FRAMES_PER_SECOND = 60, MOST_FRAMES = 1000000 };
enum { LARGEST_SIDE = 32768, LARGEST_PIXELS = 1 << 28, SCHEMA = 1 };

struct options {
    const char *scene, *out;
    int height, width, threads, reps, warmup;
    int frames, first_frame; // of an animation; 0 frames: a still picture
    bool aov, json, jsonl;
    struct scene_overrides overrides;
};

// What the operating system says of this process and machine, to be taken as differences.
struct conditions {
    long steal_ticks, ctx_voluntary, ctx_involuntary, faults_minor, faults_major, max_rss_kib;
};

static const char USAGE[] =
    "usage: render SCENE.json -n HEIGHT [options]\n"
    "  -n HEIGHT, --height   picture height in pixels\n"
    "  -w WIDTH, --width     default: round(HEIGHT*16/9)\n"
    "  -o FILE.exr           write the picture of the exact camera (float, linear RGB)\n"
    "  --aov                 with depth, shape id, normal and evaluation count per pixel\n"
    "  --threads T           default 1\n"
    "  --reps R              timed frames, default 1; all but the first are moved by a hair\n"
    "  --frames N            an animation of N frames in place of those: frame k is at k/60 s, "
    "shapes\n"
    "                        follow their paths, the camera stays; -o writes the first of them\n"
    "  --first-frame K       goes on with the animation's frame K: after an interruption\n"
    "  --warmup K            frames before those, marked as warm-up, default 0\n"
    "  --hit-distance X      in place of the scene's own (recorded)\n"
    "  --max-steps K         in place of the scene's own (recorded)\n"
    "  --json | --jsonl      one JSON object, or one JSON line per frame, on standard output\n"
    "  --list                the phases and what they are\n"
    "exit status: 0 done; 2 bad argument, scene or output; 3 the CPU lacks the instruction set;\n"
    "             4 the phase does not support this scene or option; 5 out of memory\n";

static int complain(int status, const char *format, ...) __attribute__((format(printf, 2, 3)));
static int complain(int status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fputs("render: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return status;
}

// What was printed so far has arrived, or that is the error.
static int flush_output(void) {
    if (fflush(stdout) != 0 || ferror(stdout))
        return complain(BAD_INPUT, "standard output cannot be written: %s", strerror(errno));
    return OK;
}

static bool whole_number(const char *text, long least, long most, int *out) {
    char *end;
    errno = 0;
    long value = strtol(text, &end, 10);
    if (errno || end == text || *end || value < least || value > most)
        return false;
    *out = (int)value;
    return true;
}

// What each option says by itself is right.
static int good_together(int argc, char **argv, struct options *o) {
    if (optind + 1 != argc)
        return complain(BAD_INPUT, "exactly one SCENE.json is required; see render -h");
    o->scene = argv[optind];
    if (o->height == 0)
        return complain(BAD_INPUT, "-n HEIGHT is required; see render -h");
    if (o->json && o->jsonl)
        return complain(BAD_INPUT, "--json and --jsonl exclude each other");
    if (o->frames && o->reps)
        return complain(BAD_INPUT, "--frames and --reps exclude each other");
    if (o->first_frame && !o->frames)
        return complain(BAD_INPUT, "--first-frame is of --frames: give the animation's length too");
    if (o->first_frame && o->first_frame >= o->frames)
        return complain(BAD_INPUT, "--first-frame %d: an animation of %d frames ends with frame %d",
                        o->first_frame, o->frames, o->frames - 1);
    if (!o->frames && !o->reps)
        o->reps = 1;
    if (o->width == 0)
        o->width = (int)lround(o->height * 16.0 / 9.0);
    if ((long)o->width * o->height > LARGEST_PIXELS)
        return complain(BAD_INPUT, "%d x %d pixels; at most %d pixels are allowed", o->width,
                        o->height, LARGEST_PIXELS);
    return OK;
}

enum { AOV = 256, THREADS, REPS, WARMUP, HIT, STEPS, JSON, JSONL, LIST, FRAMES, FIRST };
static const struct option known[] = {{"height", required_argument, 0, 'n'},
                                      {"width", required_argument, 0, 'w'},
                                      {"output", required_argument, 0, 'o'},
                                      {"aov", no_argument, 0, AOV},
                                      {"threads", required_argument, 0, THREADS},
                                      {"reps", required_argument, 0, REPS},
                                      {"warmup", required_argument, 0, WARMUP},
                                      {"frames", required_argument, 0, FRAMES},
                                      {"first-frame", required_argument, 0, FIRST},
                                      {"hit-distance", required_argument, 0, HIT},
                                      {"max-steps", required_argument, 0, STEPS},
                                      {"json", no_argument, 0, JSON},
                                      {"jsonl", no_argument, 0, JSONL},
                                      {"list", no_argument, 0, LIST},
                                      {"help", no_argument, 0, 'h'},
                                      {0, 0, 0, 0}};

// The value of an option that has one, into `o`. NULL, or what is required in its place.
static const char *take(int option, const char *value, struct options *o) {
    bool good = true;
    char *end;
    const char *wanted = "";
    switch (option) {
    case 'n':
        good = whole_number(value, 1, LARGEST_SIDE, &o->height);
        wanted = "-n: a height of 1 to 32768 pixels";
        break;
    case 'w':
        good = whole_number(value, 1, LARGEST_SIDE, &o->width);
        wanted = "-w: a width of 1 to 32768 pixels";
        break;
    case 'o': o->out = value; break;
    case THREADS:
        good = whole_number(value, 1, 4096, &o->threads);
        wanted = "--threads: 1 to 4096";
        break;
    case REPS:
        good = whole_number(value, 1, 1000000, &o->reps);
        wanted = "--reps: 1 to 1000000";
        break;
    case WARMUP:
        good = whole_number(value, 0, 1000000, &o->warmup);
        wanted = "--warmup: 0 to 1000000";
        break;
    case FRAMES:
        good = whole_number(value, 1, MOST_FRAMES, &o->frames);
        wanted = "--frames: 1 to 1000000";
        break;
    case FIRST:
        good = whole_number(value, 0, MOST_FRAMES, &o->first_frame);
        wanted = "--first-frame: 0 to 1000000";
        break;
    case HIT:
        o->overrides.hit_distance = strtod(value, &end);
        good = end != value && !*end && o->overrides.hit_distance >= 1e-9 &&
               o->overrides.hit_distance <= 1e9;
        wanted = "--hit-distance: a length of 1e-9 to 1e9";
        break;
    case STEPS:
        good = whole_number(value, 1, 1000000000, &o->overrides.max_steps);
        wanted = "--max-steps: 1 to 1000000000";
        break;
    }
    return good ? NULL : wanted;
}

// Parses into `o`; returns OK, or the status to exit with (−1: --help or --list was served).
static int list_phases(void);
static int parse(int argc, char **argv, struct options *o) {
    *o = (struct options){.threads = 1};
    opterr = 0;
    for (int c; (c = getopt_long(argc, argv, ":n:w:o:h", known, NULL)) != -1;) {
        const char *wanted = NULL;
        switch (c) {
        case AOV: o->aov = true; break;
        case JSON: o->json = true; break;
        case JSONL: o->jsonl = true; break;
        case LIST: return list_phases();
        case 'h': fputs(USAGE, stdout); return -1;
        case ':': return complain(BAD_INPUT, "%s: a value is required", argv[optind - 1]);
        case '?': return complain(BAD_INPUT, "%s: unknown option; see render -h", argv[optind - 1]);
        default: wanted = take(c, optarg, o);
        }
        if (wanted)
            return complain(BAD_INPUT, "%s is required, not \"%s\"", wanted, optarg);
    }
    return good_together(argc, argv, o);
}

static int by_order(const void *a, const void *b) {
    const json_t *const *x = a, *const *y = b;
    json_int_t p = json_integer_value(json_object_get(*x, "order"));
    json_int_t q = json_integer_value(json_object_get(*y, "order"));
    return (p > q) - (p < q);
}

// The phases lie in ROOT/phases; this program is ROOT/build/NAME/render, or build/asan/NAME/render.
static int list_phases(void) {
    char path[4096] = "";
    ssize_t length = readlink("/proc/self/exe", path, sizeof path - 64);
    enum { MOST = 256 };
    json_t *phases[MOST];
    size_t count = 0;
    while (length > 0 && count == 0) {
        while (length > 0 && path[--length] != '/')
            continue;
        strcpy(path + length, "/phases/*/phase.json");
        glob_t found;
        if (glob(path, 0, NULL, &found) != 0)
            continue;
        for (size_t i = 0; i < found.gl_pathc && count < MOST; i++)
            if ((phases[count] = json_load_file(found.gl_pathv[i], 0, NULL)))
                count++;
        globfree(&found);
    }
    if (count == 0)
        return complain(BAD_INPUT, "%s: no phase found", path);
    qsort(phases, count, sizeof *phases, by_order);
    for (size_t i = 0; i < count; i++) {
        const char *name = json_string_value(json_object_get(phases[i], "name"));
        const char *title = json_string_value(json_object_get(phases[i], "title"));
        const char *idea = json_string_value(json_object_get(phases[i], "idea"));
        printf("%-10s %s: %s\n", name ? name : "?", title ? title : "?", idea ? idea : "?");
        json_decref(phases[i]);
    }
    return -1;
}

// VmHWM, of this program alone: getrusage's ru_maxrss outlives exec, so that it is the parent's where a script with
// more memory than the render has started it. 0: not told.
static long peak_rss_kib(void) {
    long kib = 0;
    char line[256];
    FILE *status = fopen("/proc/self/status", "r");
    while (status && fgets(line, sizeof line, status))
        if (sscanf(line, "VmHWM: %ld kB", &kib) == 1)
            break;
    if (status)
        fclose(status);
    return kib;
}

static struct conditions conditions_now(void) {
    struct conditions now = {0};
    FILE *stat = fopen("/proc/stat", "r");
    if (stat) { // user nice system idle iowait irq softirq steal
        if (fscanf(stat, "cpu %*d %*d %*d %*d %*d %*d %*d %ld", &now.steal_ticks) != 1)
            now.steal_ticks = 0;
        fclose(stat);
    }
    struct rusage usage;
    if (getrusage(RUSAGE_SELF, &usage) == 0) {
        now.ctx_voluntary = usage.ru_nvcsw;
        now.ctx_involuntary = usage.ru_nivcsw;
        now.faults_minor = usage.ru_minflt;
        now.faults_major = usage.ru_majflt;
    }
    now.max_rss_kib = peak_rss_kib();
    return now;
}

static int vector_bits(void) {
    int lanes = variant_here().lanes;
    int bits = lanes * (strcmp(PHASE_PRECISION, "float") == 0 ? 32 : 64);
    int widest =
        strstr(variant_here().isa, "avx512") ? 512 : 256; // a phase's lanes may be several vectors
    return lanes == 1 ? 0 : bits > widest ? widest : bits;
}

static int pinned_cpu(void) {
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) != 0 || CPU_COUNT(&set) != 1)
        return -1;
    for (int cpu = 0; cpu < CPU_SETSIZE; cpu++)
        if (CPU_ISSET(cpu, &set))
            return cpu;
    return -1;
}

struct session {
    struct options options;
    struct scene scene;
    struct model moving; // the scene's, with shapes where a frame of an animation has them
    struct prepared *prepared;
    struct frame frame;
    struct presenter *presenter;
    uint8_t *rgb8;
    double tsc_hz, core_hz_load;
    uint64_t overhead, prepare_ns;
    json_t *frames;
};

// JSON is UTF-8, file names are bytes: what is not ASCII is replaced where
// only a record is written.
static const char *in_ascii(const char *text, char ascii[4096]) {
    size_t i = 0;
    for (; text && text[i] && i < 4095; i++)
        ascii[i] = (unsigned char)text[i] < 0x80 ? text[i] : '?';
    ascii[i] = '\0';
    return text ? ascii : NULL;
}

// What kernel a phase that generates them runs: all null of one that does not.
static bool add_kernel(json_t *header, const struct session *s) {
    const struct kernel_facts *facts = phase_kernel ? phase_kernel(s->prepared) : NULL;
    char said[320] = "generated";
    if (facts && !facts->generated)
        snprintf(said, sizeof said, "general: %s", facts->reason);
    json_t *kernel = json_pack(
        "{s:s?, s:s?, s:s?, s:o?, s:o?, s:o?}", "kernel", facts ? said : NULL, "kernel_hash",
        facts ? facts->hash : NULL, "kernel_compiler", facts ? facts->compiler : NULL,
        "kernel_generate_ns", facts ? json_integer((json_int_t)facts->generate_ns) : NULL,
        "kernel_compile_ns", facts ? json_integer((json_int_t)facts->compile_ns) : NULL,
        "kernel_load_ns", facts ? json_integer((json_int_t)facts->load_ns) : NULL);
    bool added = header && kernel && json_object_update(header, kernel) == 0;
    json_decref(kernel);
    return added;
}

static json_t *header(const struct session *s) {
    char image[4096];
    const struct limits *march = &s->scene.model.march;
    const struct variant variant = variant_here();
    const struct scene_overrides *over = &s->options.overrides;
    json_t *about = json_pack(
        "{s:i, s:s, s:s, s:s, s:s, s:i, s:i, s:i, s:s, s:s, s:i, s:s, s:s, s:s, s:f, s:i, s:b, "
        "s:I, s:I, s:f, s:f, s:i, s:s?, s:s?, }",
        "schema", SCHEMA, "phase", PHASE_NAME, "flags_from", PHASE_FLAGS_FROM, "scene",
        s->scene.name, "scene_hash", s->scene.hash, "width", s->options.width, "height",
        s->options.height, "threads", s->options.threads, "isa", variant.isa, "precision",
        PHASE_PRECISION, "lanes", variant.lanes, "flags", variant.flags, "compiler", PHASE_COMPILER,
        "libc", gnu_get_libc_version(), "hit_distance", march->hit_distance, "max_steps",
        march->max_steps, "overridden", over->hit_distance > 0 || over->max_steps > 0, "prepare_ns",
        (json_int_t)s->prepare_ns, "timer_overhead_cycles", (json_int_t)s->overhead, "tsc_hz",
        s->tsc_hz, "core_hz_load", s->core_hz_load, "cpu", pinned_cpu(), "image",
        in_ascii(s->options.out, image), "settings",
        phase_settings ? phase_settings(s->prepared) : NULL);
    if (add_kernel(about, s))
        return about;
    json_decref(about);
    return NULL;
}

static bool print_json(json_t *object) {
    bool ok = object && json_dumpf(object, stdout, JSON_REAL_PRECISION(15)) == 0 &&
              fputc('\n', stdout) != EOF && fflush(stdout) == 0;
    json_decref(object);
    return ok;
}

// A hair: a millionth of a scene unit per frame, so that nothing of the last frame can be kept.
static struct view moved(const struct view *exact, int hairs) {
    struct view view = *exact;
    for (int i = 0; i < 3; i++)
        view.position[i] += 1e-6 * hairs * (view.right[i] + view.up[i]);
    return view;
}

// What a frame is, beside the picture that it leaves.
struct measured {
    struct conditions before, after;
    double core_before, core_after, scene_time;
    uint64_t ns, tsc, update_ns, present_ns;
};

// The frame's time is that of rendering, and in an animation of the update before it.
static bool timed_frame(struct session *s, const struct view *view, struct measured *m) {
    bool moves = s->options.frames > 0, done = true;
    m->core_before = s->tsc_hz > 0 ? timer_core_hz(s->tsc_hz, 8) : 0;
    m->before = conditions_now();
    m->ns = timer_ns();
    m->tsc = timer_tsc_begin();
    if (moves) {
        done = phase_update(s->prepared, &s->moving);
        m->update_ns = timer_ns() - m->ns;
    }
    done = done && phase_render(s->prepared, view, &s->frame);
    m->tsc = timer_tsc_end() - m->tsc;
    m->ns = timer_ns() - m->ns;
    m->after = conditions_now();
    m->core_after = s->tsc_hz > 0 ? timer_core_hz(s->tsc_hz, 8) : 0;
    return done;
}

static json_t *record_of(const struct measured *m, const struct session *s, int index, bool warmup,
                         bool first) {
    const struct conditions *before = &m->before, *after = &m->after;
    return json_pack("{s:i, s:b, s:b, s:I, s:I, s:f, s:I, s:f, s:f, s:f, s:f, s:I, s:I, s:I, s:I, "
                     "s:I, s:I, s:I}",
                     "frame", index, "warmup", warmup, "first", first, "ns", (json_int_t)m->ns,
                     "update_ns", (json_int_t)m->update_ns, "scene_time", m->scene_time,
                     "tsc_cycles", (json_int_t)m->tsc, "core_cycles",
                     round((double)m->ns * (m->core_before + m->core_after) / 2e9), "tsc_hz",
                     s->tsc_hz, "core_hz_before", m->core_before, "core_hz_after", m->core_after,
                     "present_ns", (json_int_t)m->present_ns, "steal_ticks",
                     (json_int_t)(after->steal_ticks - before->steal_ticks), "ctx_voluntary",
                     (json_int_t)(after->ctx_voluntary - before->ctx_voluntary), "ctx_involuntary",
                     (json_int_t)(after->ctx_involuntary - before->ctx_involuntary), "faults_minor",
                     (json_int_t)(after->faults_minor - before->faults_minor), "faults_major",
                     (json_int_t)(after->faults_major - before->faults_major), "max_rss_kib",
                     (json_int_t)after->max_rss_kib);
}

static int one_frame(struct session *s, int index, bool warmup, bool first) {
    bool moves = s->options.frames > 0, exact = index == s->options.first_frame;
    // Of an animation nothing can be kept anyway, and frame k is the same picture wherever it begins.
    struct view view = moves ? s->scene.view : moved(&s->scene.view, index);
    struct measured m = {.scene_time = moves ? (double)index / FRAMES_PER_SECOND : 0};
    if (moves)
        model_move(&s->scene.model, m.scene_time, &s->moving);
    if (exact)
        count_begin();
    bool done = timed_frame(s, &view, &m);
    if (exact)
        count_end();
    if (!done)
        return complain(NO_MEMORY, "out of memory while rendering");
    m.present_ns = timer_ns();
    frame_present(s->presenter, &s->frame, s->rgb8);
    m.present_ns = timer_ns() - m.present_ns;
    if (exact && s->options.out) {
        char error[512];
        if (!frame_write_exr(&s->frame, s->options.out, error))
            return complain(BAD_INPUT, "%s", error);
    }
    json_t *record = record_of(&m, s, index, warmup, first);
    if (s->options.jsonl) {
        json_t *line = header(s);
        if (!line || !record || json_object_update(line, record) != 0)
            return complain(NO_MEMORY, "out of memory");
        json_decref(record);
        if (!print_json(line))
            return complain(BAD_INPUT, "standard output cannot be written: %s", strerror(errno));
    } else if (s->options.json) {
        if (!record || json_array_append_new(s->frames, record) != 0)
            return complain(NO_MEMORY, "out of memory");
    } else {
        json_decref(record);
        double pixels = (double)s->frame.width * s->frame.height;
        printf("%s %s %dx%d: %.3f ms, %.1f ns/pixel, %.3g TSC cycles at %.3f GHz, core clock "
               "%.2f GHz%s\n",
               PHASE_NAME, s->scene.name, s->frame.width, s->frame.height, (double)m.ns / 1e6,
               (double)m.ns / pixels, (double)m.tsc, s->tsc_hz / 1e9,
               (m.core_before + m.core_after) / 2e9, warmup ? " (warm-up)" : "");
    }
    return OK;
}

static int run(struct session *s) {
    const struct options *o = &s->options;
    static const char *const planes[] = {PHASE_PLANES NULL};
    if (!frame_create(&s->frame, o->width, o->height, o->aov, planes) ||
        !(s->presenter = presenter_create()) ||
        !(s->rgb8 = malloc(3 * (size_t)o->width * (size_t)o->height)) ||
        !(s->frames = json_array()))
        return complain(NO_MEMORY, "out of memory for %d x %d pixels", o->width, o->height);
    s->moving = s->scene.model;
    s->moving.shapes = malloc((size_t)s->moving.shape_count * sizeof *s->moving.shapes);
    if (!s->moving.shapes)
        return complain(NO_MEMORY, "out of memory for %d shapes", s->moving.shape_count);
    // The clocks' rates cost 25 ms, many times a small picture: 0 where it is all that is wanted.
    bool timed = getenv("STEPWISE_UNTIMED") == NULL;
    s->tsc_hz = timed ? timer_tsc_hz(20) : 0;
    s->overhead = timer_overhead_cycles();
    s->core_hz_load =
        timed && vector_bits() ? timer_core_hz_under_load(s->tsc_hz, 8, vector_bits()) : 0;
    uint64_t begin = timer_ns();
    s->prepared = phase_prepare(&s->scene.model, s->options.threads);
    s->prepare_ns = timer_ns() - begin;
    if (!s->prepared)
        return complain(NO_MEMORY, "out of memory while preparing the scene");
    int begin_with = o->first_frame - o->warmup, end = o->frames ? o->frames : o->reps;
    for (int i = begin_with; i < end; i++) {
        int status = one_frame(s, i, i < o->first_frame, i == begin_with);
        if (status != OK)
            return status;
    }
    if (o->json) {
        json_t *object = header(s);
        if (!object || json_object_set(object, "frames", s->frames) != 0)
            return complain(NO_MEMORY, "out of memory");
#ifdef STEPWISE_COUNT
        json_t *counts = count_result();
        if (!counts || json_object_update(object, counts) != 0)
            return complain(NO_MEMORY, "out of memory while counting");
        json_decref(counts);
#endif
        if (!print_json(object))
            return complain(BAD_INPUT, "standard output cannot be written: %s", strerror(errno));
    }
    return flush_output();
}

int main(int argc, char **argv) {
    struct session s = {0};
    int status = parse(argc, argv, &s.options);
    if (status != OK)
        return status < 0 ? flush_output() : status;
    const char *missing = variant_missing();
    if (missing)
        return complain(NO_ISA, "%s needs %s, which this CPU lacks", PHASE_NAME, missing);
    if (s.options.threads > 1 && !PHASE_THREADS)
        return complain(UNSUPPORTED, "%s runs on one thread; --threads 1 is all it takes",
                        PHASE_NAME);
    char error[SCENE_ERROR_SIZE];
    if (!scene_load(s.options.scene, &s.options.overrides, &s.scene, error))
        return complain(BAD_INPUT, "%s", error);
    const char *unsupported = phase_unsupported(&s.scene);
    if (!unsupported && phase_picture_unsupported)
        unsupported = phase_picture_unsupported(&s.scene, s.options.width, s.options.height);
    if (unsupported)
        status = complain(UNSUPPORTED, "%s: %s", s.options.scene, unsupported);
    else if (s.options.frames && !s.scene.model.features.motion)
        status = complain(BAD_INPUT,
                          "%s: --frames: no shape has a path, so that all frames would be one; "
                          "--reps renders a still picture again",
                          s.options.scene);
    else if (s.options.out && !frame_writable(s.options.out, error))
        status = complain(BAD_INPUT, "%s", error); // before a long render, not after
    else
        status = run(&s);
    if (s.prepared)
        phase_release(s.prepared);
    json_decref(s.frames);
    free(s.moving.shapes);
    free(s.rgb8);
    presenter_free(s.presenter);
    frame_free(&s.frame);
    scene_free(&s.scene);
    return status;
}
