// What distinguishes the phases of this family: the default settings and the builds of tile.c.
#pragma once

#include "number/format.h"
#include "tile.h"

// Three Newton steps in each root and no wrong block, unless STEPWISE_FIXED says otherwise.
static const struct settings DEFAULTS = {
    .bits = 20, .unit = 0, .newton_steps = 3, .clear = CLEAR_LISTS};

static inline workers_task *render_tile_in(int lanes) {
    return lanes == 16 ? lanes16_render_tile : lanes8_render_tile;
}
