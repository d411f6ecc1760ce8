// The Mandelbulb's exact surface: with n iterations the set |zₙ| = 1, where its estimate is 0.
#pragma once

#include "trace.h"

// Replaces the hit by the first crossing of a Mandelbulb's surface, if that comes first. `hit` is that of the solids,
// proved or not. Status: proved, or undecided where a ray touches, starts on a surface or inside of two shapes.
void first_bulb(const struct prepared *prepared, const struct ray_q *ray, struct ivq reach,
                struct hit *hit);

// Returns whether a Mandelbulb is met for 0 ≤ s ≤ reach; `status` becomes undecided where that is not proved.
bool bulb_blocks(const struct prepared *prepared, const struct ray_q *ray, double reach,
                 enum status *status);

// Computes the unit gradient of |zₙ|² at the point, by central differences in quads: correct to about 1e-10.
void bulb_normal(const struct solid *solid, const struct ivq point[3], double n[3]);
