// What distinguishes the phases of this family: the default settings and the builds of tile.c.
#pragma once

#include "number/format.h"
#include "tile.h"

// The article's square roots and its test of blocks, unless STEPWISE_FIXED says otherwise.
static const struct settings DEFAULTS = {
    .bits = 20, .unit = 0, .newton_steps = 0, .clear = CLEAR_CORNERS};

static inline workers_task *render_tile_in(int lanes) {
    (void)lanes; // one
    return lanes1_render_tile;
}
