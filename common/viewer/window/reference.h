// PSNR of what is shown, from a reference frame that a thread draws in the background.
#pragma once

#include <stdbool.h>

#include "scene/scene.h"

struct show;
struct viewer_phase;
struct world;

// What was compared: the same view by two phases, at this size. The phases' frames are functions of
// the view, so the thread draws both anew at the size that the reference can draw in about a second.
struct comparison {
    const struct viewer_phase *phase, *reference;
    const struct world *world;
    int width, height;
    double psnr;                  // in dB, of linear colours
    char error[SCENE_ERROR_SIZE]; // not empty: why there is none
};

struct reference;

// Starts the thread. Returns NULL if it cannot be had.
struct reference *reference_start(void);
// Asks for a comparison of what `show` shows, unless one is being made. Returns whether it was taken.
bool reference_ask(struct reference *reference, const struct show *show);
// Returns true once for each finished comparison.
bool reference_result(struct reference *reference, struct comparison *result);
void reference_end(struct reference *reference);
