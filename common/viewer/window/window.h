// What the files of the window share.
#pragma once

#include <SDL.h>
#include <stdio.h>

#include "viewer/window/pace.h"
#include "viewer/window/reference.h"
#include "viewer/window/throttle.h"
#include "viewer/world.h"

struct script;
struct show;

struct window {
    SDL_Window *window;
    struct show *show;
    struct reference *reference;
    struct comparison compared; // phase NULL: none yet
    struct pace pace;
    struct throttle throttle;
    struct times frames, renders; // from picture to picture; of rendering alone
    double other_ms;              // of a frame: all but rendering, smoothed
    struct camera before;         // of the last frame, to see whether something moves
    uint32_t moved;               // when something did, in SDL ticks
    bool divider_moves;           // in this frame: compose again, render nothing
    struct script *script;        // being played, NULL: none
    FILE *recording;              // NULL: none
    char recording_name[64];
    char message[SCENE_ERROR_SIZE]; // shown until message_until, in SDL ticks
    uint32_t message_until;
    double speed; // scene units a second
    bool overlay, help, paused, dragging, open;
    bool rightward; // the D that is held moves
};

// The loop (window.c) calls keys and overlay, and all three call the actions below.

// overlay.c: draws text on the canvas.
void window_overlay(struct window *w);

// keys.c: what an event does.
void window_event(struct window *w, const SDL_Event *event);
// keys.c: moves camera and light by the keys that are held, for `seconds`.
void window_held_keys(struct window *w, double seconds);

// actions.c: shows a line for four seconds.
void window_say(struct window *w, const char *format, ...) __attribute__((format(printf, 2, 3)));
// Opens a phase or a scene; a refusal is said and nothing changes.
void window_open(struct window *w, const struct viewer_phase *phase, const struct world *world);
// Opens the phase again, for its new settings.
void window_reopen(struct window *w);
// Turns the throttle on or off.
void window_throttle(struct window *w, bool on);
// Starts measuring anew, after a change of what is drawn.
void window_restart(struct window *w);
// Copies the canvas to the window: SDL's window surface is its copy, so that a screenshot has what is seen.
bool window_present(struct window *w);
// Scenes are of any size: a third of the way to what one sees (the median depth of a few pixels) in a second. Where
// nothing is seen: a tenth of the way to the light.
double window_fitting_speed(struct show *show);
