// A packet of soft shadow rays, and what the files of shadow/ share of it.
#pragma once

#include "simd/simd.h"
#include "types/known_scene.h"

struct tile_context;

// Rays from `point` (`local` in the frame of the shape that they leave), and the least ratio so far. Only t from near
// to far counts.
struct soft_packet {
    struct vec point, local, to_light;
    vfloat shape, near, far, best;
    vmask active;
};

// A torus that its rays leave inward is seen again on its far side. Nearer than this share of the tube's radius
// its distance along the ray is flat to 1e-5.
#define NEAR_TUBE 0.01f

// Returns the lesser of w->best and the least ratio of the copies of shape i, to within `room`.
KERNEL_SHARED vfloat widest_in_cells(int i, const struct soft_packet *w, float room,
                                     const struct prepared *scene);

// Lowers the ratios of all queued rays, in field S_LIT, by the scene's Mandelbulb.
KERNEL_SHARED void search_bulb(const struct tile_context *work);
