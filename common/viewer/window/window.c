// The window: its loop.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "timing/timer.h"
#include "viewer/script.h"
#include "viewer/show.h"
#include "viewer/viewer.h"
#include "viewer/window/window.h"

enum { STILL_AFTER_MS = 400, FRAME_NS = 16666667, SECOND = 1000000000 };

// The reference may refuse a scene or a size: then the phase is shown alone.
static void without_reference(struct window *w, const char *error) {
    struct show *show = w->show;
    window_say(w, "%s", error);
    show->split = false;
    show->mode = show->mode == MODE_DIFFERENCE ? MODE_COLOURS : show->mode;
    window_restart(w);
}

// Renders what is to be seen. While the divider moves over a still picture, that stays as it is.
static bool render(struct window *w, bool still, char *error) {
    struct show *show = w->show;
    if (still && show->split && w->divider_moves && w->renders.count > 0) {
        show_compose(show);
        return true;
    }
    show->height = w->pace.height;
    if (!show_draw(show, error)) {
        bool compares = show_compares(show);
        if (compares)
            without_reference(w, error);
        return compares;
    }
    times_add(&w->renders, show_ns(show));
    if (w->recording && !script_record(w->recording, show))
        window_say(w, "%s: cannot be written", w->recording_name);
    return true;
}

// Draws, shows, chooses the next frame's resolution. False: end, with one line in `error`.
static bool frame(struct window *w, char *error) {
    struct show *show = w->show;
    uint64_t begin = timer_ns();
    int renders = w->renders.next;
    if (memcmp(&w->before, &show->camera, sizeof w->before) != 0)
        w->moved = SDL_GetTicks();
    w->before = show->camera;
    bool still = SDL_GetTicks() - w->moved > STILL_AFTER_MS;
    if (!render(w, still, error))
        return false;
    window_overlay(w);
    if (!window_present(w)) {
        snprintf(error, SCENE_ERROR_SIZE, "the window cannot be drawn: %s", SDL_GetError());
        return false;
    }
    w->divider_moves = false;
    if (w->renders.next == renders)
        return true; // nothing was rendered
    double render_ms = (double)show_ns(show) / 1e6;
    double other = (double)(timer_ns() - begin) / 1e6 - render_ms;
    w->other_ms = w->other_ms > 0 ? 0.9 * w->other_ms + 0.1 * other : other;
    if (w->throttle.on)
        w->pace.adaptive = throttle_spent(&w->throttle);
    if (w->throttle.on &&
        throttle_frame(&w->throttle, render_ms, w->other_ms, show->height == show->canvas.height)) {
        stage_settings(throttle_settings(&w->throttle));
        window_reopen(w);
        w->renders = (struct times){0};
    }
    if (pace_frame(&w->pace, render_ms, w->other_ms, still))
        w->renders = (struct times){0};
    return true;
}

// The script's next frame, or the animation's and the held keys'.
static bool advance(struct window *w, double seconds, char *error) {
    struct show *show = w->show;
    if (w->script) {
        const struct viewer_phase *phase = show->left.phase;
        const struct world *world = show->world;
        int more = script_next(w->script, show, error);
        if (more < 0)
            return false;
        if (more == 0) {
            script_free(w->script);
            w->script = NULL;
            window_say(w, "the script is over");
        }
        if (phase != show->left.phase || world != show->world)
            window_restart(w);
        return true;
    }
    window_held_keys(w, fmin(seconds, 0.1));
    if (!w->paused && (show->world->scene.model.animated || show->camera.flies))
        show->camera.seconds += seconds;
    camera_fly(show->world, &show->camera);
    return true;
}

static int run(struct window *w) {
    char error[SCENE_ERROR_SIZE] = "";
    uint64_t last = timer_ns(), asked = 0;
    bool good = true;
    while (w->open && good) {
        SDL_Event event;
        while (SDL_PollEvent(&event))
            window_event(w, &event);
        uint64_t now = timer_ns();
        if (now - last < FRAME_NS) {
            SDL_Delay((Uint32)((FRAME_NS - (now - last)) / 1000000)); // rounds down, then waits
            while ((now = timer_ns()) - last < FRAME_NS)
                continue;
        }
        times_add(&w->frames, now - last);
        good = advance(w, (double)(now - last) / 1e9, error) && frame(w, error);
        last = now;
        if (w->reference && now - asked > SECOND && w->show->reference != w->show->left.phase &&
            reference_ask(w->reference, w->show))
            asked = now;
        if (w->reference)
            reference_result(w->reference, &w->compared);
    }
    return good ? OK : viewer_error(BAD_INPUT, "%s", error);
}

// Starts SDL, by X11 or Wayland: left alone it takes a driver that shows nothing where there is no
// display. The environment's SDL_VIDEODRIVER comes first.
static bool start_sdl(void) {
    SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
    SDL_SetHint(SDL_HINT_VIDEODRIVER, getenv("WAYLAND_DISPLAY") ? "wayland,x11" : "x11");
    return SDL_Init(SDL_INIT_VIDEO) == 0;
}

int window_run(const struct viewer_options *options, struct show *show) {
    char error[SCENE_ERROR_SIZE];
    struct window w = {.show = show, .overlay = true, .open = true, .pace = {.adaptive = true}};
    struct script script = {0};
    if (options->script && !script_read(&script, options->script, error))
        return viewer_error(BAD_INPUT, "%s", error);
    w.script = options->script ? &script : NULL;
    if (!start_sdl()) {
        char reason[256];
        snprintf(reason, sizeof reason, "%s", SDL_GetError());
        SDL_Quit();
        script_free(&script);
        return viewer_error(BAD_INPUT, "no display: %s; --script FILE --headless -o DIR needs none",
                            reason);
    }
    w.window = SDL_CreateWindow("Stepwise", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                                options->width, options->height, SDL_WINDOW_RESIZABLE);
    w.speed = window_fitting_speed(show);
    w.reference = reference_start();
    window_restart(&w);
    int status = w.window ? run(&w) : viewer_error(BAD_INPUT, "no window: %s", SDL_GetError());
    reference_end(w.reference);
    if (w.recording)
        fclose(w.recording);
    if (w.script)
        script_free(w.script);
    SDL_DestroyWindow(w.window);
    SDL_Quit();
    return status;
}
