// The root of a generated kernel: common/build/phase_info.py puts what this includes in its place and into the program,
// kernel/sources.c puts scene_kernel.h where it belongs.
#define SCENE_KERNEL 1
#include "kernel/kernel_scene.h"

#include "core/worker_scratch.h"
#include "kernel/kernel.h"

#include "bulb/bulb_march.c"
#include "bulb/bulb_shadows.c"
#include "core/analytic_tile.c"
#include "core/shading.c"
#include "hit/primary_hits.c"
#include "repetition/repeated_bundles.c"
#include "repetition/repeated_rays.c"
#include "shadow/cast_shadows.c"
#include "shadow/shadow_candidates.c"
#include "shadow/shadow_cull.c"
#include "shadow/soft_shadow.c"

static int kernel_tiles(const struct job *job) {
    return count_tiles(job);
}

static void kernel_tile(const struct job *job, int tile, void *own) {
    draw_analytic_tile(job, tile,
                       scratch_at(own, KNOWN(job->prepared)->model.shape_count, REFILLED_PACKETS));
}

#ifdef __clang__
#define COMPILER __VERSION__
#else
#define COMPILER "gcc " __VERSION__
#endif
const struct scene_kernel stepwise_kernel = {
    KERNEL_TAG, COMPILER, SCRATCH_SIZE(SHAPES, REFILLED_PACKETS), kernel_tiles, kernel_tile};
