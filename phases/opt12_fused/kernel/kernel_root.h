// The end of a generated kernel's source: what the program calls of it. A scene of planes and solids is drawn by fused/,
// another as the parent draws it; what a kernel does not call is not compiled.
#include "frame/worker_scratch.h"
#include "kernel/group_calls.h"
#include "kernel/kernel.h"

// Each needs those before it, and the files that the kernel's text has before this one.
#include "fused/fused.h"

#include "fused/light.h"

#include "fused/torus.h"

#include "fused/follow.h"

#include "fused/smooth.h"

#include "fused/rows.h"

#include "fused/begin.h"

#ifdef __clang__
#define COMPILER __VERSION__
#else
#define COMPILER "gcc " __VERSION__
#endif

#if FUSED
const struct scene_kernel stepwise_kernel = {KERNEL_TAG,  COMPILER,   ROWS * sizeof(struct smooth),
                                             fused_tiles, fused_tile, sizeof(struct fused),
                                             fused_begin};
#else
static void kernel_tile(const void *data, int tile, void *memory) {
    const struct job *job = data;
    draw_analytic_tile(
        job, tile, scratch_at(memory, KNOWN(job->prepared)->model.shape_count, REFILLED_PACKETS));
}

const struct scene_kernel stepwise_kernel = {
    KERNEL_TAG,  COMPILER, SCRATCH_SIZE(SHAPES, REFILLED_PACKETS), count_tiles,
    kernel_tile, 0,        HAS_GROUPS ? take_groups : NULL};
#endif
