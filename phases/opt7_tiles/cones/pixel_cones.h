// Cones around the camera rays of rectangles of pixels.
#pragma once

#include "simd/simd.h"

struct cone_packet; // cones/tile_cones.h
struct job;         // core/kernel.h

// A rectangle of pixels, cut to the picture. `right` and `bottom` are one beyond its last.
struct pixel_rect {
    int left, top, right, bottom;
};

// Sets a cone for each rectangle. Returns which rectangles hold a pixel of the picture.
vmask get_cones(const struct pixel_rect rects[LANES], const struct job *job,
                struct cone_packet *cones);
