// The end of a generated kernel's source: what the program calls of it. The files before it are listed in
// phase.json ("embedded"); common/build/phase_info.py puts them one behind the other into the program.
#include "frame/worker_scratch.h"
#include "kernel/group_calls.h"
#include "kernel/kernel.h"

static void kernel_tile(const void *data, int tile, void *memory) {
    const struct job *job = data;
    draw_analytic_tile(
        job, tile, scratch_at(memory, KNOWN(job->prepared)->model.shape_count, REFILLED_PACKETS));
}

#ifdef __clang__
#define COMPILER __VERSION__
#else
#define COMPILER "gcc " __VERSION__
#endif
const struct scene_kernel stepwise_kernel = {
    KERNEL_TAG,  COMPILER, SCRATCH_SIZE(SHAPES, REFILLED_PACKETS), count_tiles,
    kernel_tile, 0,        HAS_GROUPS ? take_groups : NULL};
