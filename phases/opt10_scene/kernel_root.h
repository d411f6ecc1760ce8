// The root of a generated kernel: common/build/phase_info.py puts what this includes in its place and into the program,
// sources.c puts scene_kernel.h where it belongs.
#define SCENE_KERNEL 1
#include "kernel_known.h"

#include "desk.h"
#include "kernel.h"

#include "bulb.c"
#include "cast.c"
#include "casters.c"
#include "cells.c"
#include "clear.c"
#include "color.c"
#include "convex.c"
#include "layers.c"
#include "seen.c"
#include "umbra.c"
#include "umbra_bulbs.c"

static int kernel_tiles(const struct job *job) {
    return convex_tiles(job);
}

static void kernel_tile(const struct job *job, int tile, void *own) {
    convex_tile(job, tile, desk_at(own, KNOWN(job->prepared)->model.shape_count, POOLS));
}

#ifdef __clang__
#define COMPILER __VERSION__
#else
#define COMPILER "gcc " __VERSION__
#endif
const struct scene_kernel stepwise_kernel = {KERNEL_TAG, COMPILER, DESK_SIZE(SHAPES, POOLS),
                                             kernel_tiles, kernel_tile};
