// The end of a generated kernel's source: what the program calls of it. The files before it are listed in
// phase.json ("embedded"); common/build/phase_info.py puts them one behind the other into the program.
#include "frame/worker_scratch.h"
#include "kernel/kernel.h"

static int kernel_tiles(const struct job *job) {
    return count_tiles(job);
}

static void kernel_tile(const struct job *job, int tile, void *memory) {
    draw_analytic_tile(
        job, tile, scratch_at(memory, KNOWN(job->prepared)->model.shape_count, REFILLED_PACKETS));
}

#ifdef __clang__
#define COMPILER __VERSION__
#else
#define COMPILER "gcc " __VERSION__
#endif
const struct scene_kernel stepwise_kernel = {
    KERNEL_TAG, COMPILER, SCRATCH_SIZE(SHAPES, REFILLED_PACKETS), kernel_tiles, kernel_tile,
    0,          NULL};
