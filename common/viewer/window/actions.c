// What keys, mouse and the loop do to the window.
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "viewer/show.h"
#include "viewer/window/window.h"

enum { MESSAGE_MS = 4000 };

void window_say(struct window *w, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(w->message, sizeof w->message, format, arguments);
    va_end(arguments);
    w->message_until = SDL_GetTicks() + MESSAGE_MS;
}

void window_restart(struct window *w) {
    w->frames = w->renders = (struct times){0};
    pace_start(&w->pace, w->show->canvas.height);
}

bool window_present(struct window *w) {
    const struct canvas *canvas = &w->show->canvas;
    SDL_Surface *surface = SDL_GetWindowSurface(w->window);
    SDL_Surface *drawn =
        SDL_CreateRGBSurfaceWithFormatFrom(canvas->pixels, canvas->width, canvas->height, 32,
                                           4 * canvas->width, SDL_PIXELFORMAT_RGB888);
    bool done = surface && drawn && SDL_BlitSurface(drawn, NULL, surface, NULL) == 0 &&
                SDL_UpdateWindowSurface(w->window) == 0;
    SDL_FreeSurface(drawn);
    return done;
}

static int by_depth(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

double window_fitting_speed(struct show *show) {
    enum { COLUMNS = 16, ROWS = 9 };
    char error[SCENE_ERROR_SIZE];
    struct view view = camera_view(show->world, &show->camera);
    float hits[COLUMNS * ROWS];
    size_t count = 0;
    if (stage_render(&show->left, &view, show->camera.seconds, COLUMNS, ROWS, true, error))
        for (int i = 0; i < COLUMNS * ROWS; i++)
            if (isfinite(show->left.frame.depth[i]))
                hits[count++] = show->left.frame.depth[i];
    qsort(hits, count, sizeof *hits, by_depth);
    double light = 0;
    for (int i = 0; i < 3; i++)
        light += pow(show->camera.light[i] - show->camera.position[i], 2);
    return fmax(count > 0 ? hits[count / 2] / 3 : sqrt(light) / 10, 1e-6);
}

static void end_throttle(struct window *w) {
    w->throttle = (struct throttle){0};
    w->pace.throttled = false;
    w->pace.adaptive = true;
    stage_settings(NULL);
}

// Full resolution by the finest settings, until the throttle is spent.
static void begin_throttle(struct window *w) {
    w->throttle = (struct throttle){.on = true};
    w->pace.throttled = true;
    w->pace.adaptive = false;
    stage_settings(throttle_settings(&w->throttle));
}

void window_reopen(struct window *w) {
    char error[SCENE_ERROR_SIZE];
    if (!show_open(w->show, w->show->left.phase, w->show->world, error))
        window_say(w, "%s", error);
}

void window_throttle(struct window *w, bool on) {
    if (on && strcmp(w->show->left.phase->name, throttle_phase()) != 0) {
        window_say(w, "the throttle is of %s; P and Shift+P lead there", throttle_phase());
        return;
    }
    end_throttle(w);
    if (on)
        begin_throttle(w);
    window_reopen(w);
    window_restart(w);
}

void window_open(struct window *w, const struct viewer_phase *phase, const struct world *world) {
    char error[SCENE_ERROR_SIZE], text[256];
    // Keys wait meanwhile, so say why, on the picture that is there.
    snprintf(text, sizeof text, "preparing %.60s for %.60s ...%s", phase->name, world->scene.name,
             phase->kernel ? " a kernel for a scene takes seconds, once" : "");
    canvas_shade(&w->show->canvas, 0, w->show->canvas.height / 2 - 10, w->show->canvas.width, 34);
    canvas_text(&w->show->canvas, 20, w->show->canvas.height / 2, 2, 0xffffff, text);
    window_present(w);
    bool other = world != w->show->world;
    if (w->throttle.on && strcmp(phase->name, throttle_phase()) != 0)
        end_throttle(w);
    else if (w->throttle.on && other)
        begin_throttle(w); // what the scene before needed says nothing of this one
    if (!show_open(w->show, phase, world, error))
        window_say(w, "%s", error);
    else if (other)
        w->speed = window_fitting_speed(w->show);
    window_restart(w);
}
