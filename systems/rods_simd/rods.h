// Where the rays of a tile begin, found by rods: see rods.c.
#pragma once

#include "simd/simd.h"

struct job; // core/kernel.h
struct trace_context;

enum { TILE = 64, TILE_PIXELS = TILE * TILE }; // the largest rod

// Rods of one size, by their first pixel in the tile.
struct rod_list {
    int count;
    short x[TILE_PIXELS], y[TILE_PIXELS];
    float t[TILE_PIXELS],
        steps[TILE_PIXELS]; // where each begins, and the steps of the rods around it
};

// For each pixel: where its ray begins (+∞: it hits nothing), the steps of its rods, and its share of them. The steps
// of a rod are the share of the rod's first pixel.
struct survey {
    float start[TILE_PIXELS], steps[TILE_PIXELS], share[TILE_PIXELS];
    struct rod_list now, next;
};

// Fills start, steps and share of the tile whose first pixel is (left, top).
void march_rods(int left, int top, const struct job *job, struct point eye,
                struct trace_context *world, struct survey *survey);
