// What distinguishes the phases of this family: the default settings and the builds of tile.c.
#pragma once

#include "number/format.h"
#include "tile.h"

// The article's square roots and its test of blocks, unless STEPWISE_FIXED says otherwise.
static const struct settings DEFAULTS = {
    .bits = 20, .unit = 0, .newton_steps = 0, .clear = CLEAR_CORNERS};

static inline void render_tile_in_lanes(int lanes, const struct job *job, int tile,
                                        int *candidates) {
    (void)lanes; // one
    lanes1_render_tile(job, tile, candidates);
}
