// The phase's entry points, and the choice between the kernels for 8 and for 16 lanes: the same sources
// ("each_variant" of phase.json), built twice.
#include <stdalign.h>
#include <stdlib.h>

#include "frame/draw_path.h"
#include "frame/prepare.h"
#include "kernel/kernel.h"

// More shapes get no kernel. Without a Mandelbulb, fewer have a BVH already, and no kernel.
enum { MAX_KERNEL_SHAPES = 64 };

// The memory behind a struct prepared: the caller's pointer is to its first member.
struct phase_state {
    struct prepared prepared;
    struct workers *workers;
    const struct lane_kernel *lanes;
    struct loaded_kernel loaded;
    void *frame_memory; // of the kernel
};

const char *phase_unsupported(const struct scene *scene) {
    return draw_path_unsupported(scene);
}

const char *phase_settings(const struct prepared *prepared) {
    return draw_path_setting(prepared->path);
}

// A kernel has the shapes' positions as constants. Where they move, the general code runs, and the record
// says so.
#define REASON_MOVING "the shapes move: a kernel is generated for one place of each"

bool phase_update(struct prepared *prepared, const struct model *model) {
    struct loaded_kernel *loaded = &((struct phase_state *)prepared)->loaded; // its first member
    prepare_shapes(prepared, model);
    if (loaded->kernel) {
        kernel_unload(loaded);
        loaded->facts = (struct kernel_facts){.reason = REASON_MOVING};
    }
    return true;
}

static void make_kernel(struct phase_state *kept) {
    struct loaded_kernel *loaded = &kept->loaded;
#ifdef STEPWISE_COUNT
    loaded->facts.reason = "a counting build counts the general kernels";
#else
    if (kept->prepared.path != PATH_DEFAULT)
        loaded->facts.reason =
            "STEPWISE_PATH forces a path of the general code: no kernel is generated for that";
    else if (!kept->prepared.analytic)
        loaded->facts.reason = "the scene is marched: no kernel is generated for that";
    else if (kept->prepared.bvh.levels)
        loaded->facts.reason =
            "a scene of so many shapes has a BVH: no kernel is generated for that";
    else if (kept->prepared.model.shape_count > MAX_KERNEL_SHAPES)
        loaded->facts.reason = "more shapes than a generated kernel gains from";
    else if (kept->prepared.model.animated)
        loaded->facts.reason = REASON_MOVING; // the first update would drop it
    else
        kernel_load(&kept->prepared, variant_here().lanes, variant_here().flags, loaded);
#endif
}

const struct kernel_facts *phase_kernel(const struct prepared *prepared) {
    return &((const struct phase_state *)prepared)->loaded.facts;
}

// Starts the workers. A kernel may need more memory per worker than the general code.
static struct workers *start_team(struct phase_state *kept, const struct model *model,
                                  int threads) {
    size_t size = kept->lanes->scratch_size(model);
    const struct scene_kernel *kernel = kept->loaded.kernel;
    if (kernel && kernel->scratch_size > size)
        size = kernel->scratch_size;
    if (kernel && kernel->frame_size > 0) {
        size_t room = (kernel->frame_size + WORKERS_APART - 1) / WORKERS_APART * WORKERS_APART;
        kept->frame_memory = aligned_alloc(WORKERS_APART, room);
        if (!kept->frame_memory)
            return NULL;
    }
    return workers_start(threads, size);
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct phase_state *kept = calloc(1, sizeof *kept);
    if (!kept)
        return NULL;
    kept->lanes = lanes_here();
    kept->prepared.group_calls = kept->lanes->groups;
    kept->prepared.path = draw_path_forced();
    if (reserve_prepared(&kept->prepared, model)) {
        prepare_shapes(&kept->prepared, model);
        make_kernel(kept);
        kept->workers = start_team(kept, model, threads);
    }
    if (!kept->workers) {
        phase_release(&kept->prepared);
        return NULL;
    }
    return &kept->prepared;
}

void phase_release(struct prepared *prepared) {
    struct phase_state *kept = (struct phase_state *)prepared; // its first member
    workers_end(kept->workers);
    free(kept->frame_memory);
    kernel_unload(&kept->loaded);
    free_prepared(prepared);
    free(kept);
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    const struct phase_state *kept = (const struct phase_state *)prepared; // its first member
    bool analytic = prepared->analytic && set_local_cameras(prepared, view, kept->lanes);
    int high = tile_height(prepared, frame->height);
    // All workers read it.
    alignas(WORKERS_APART) struct job job = {
        prepared, view, frame, prepared->cameras, high, analytic, kept->frame_memory};
    const struct scene_kernel *kernel = analytic ? kept->loaded.kernel : NULL;
    if (kernel && kernel->begin && !kernel->begin(&job))
        kernel = NULL; // the general code draws
    workers_run(kept->workers, kernel ? kernel->tile : kept->lanes->tile, &job,
                kernel ? kernel->tiles(&job) : kept->lanes->tiles(&job));
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct phase_state *kept = (const struct phase_state *)prepared; // its first member
    return kept->lanes->distances(prepared, count, points, distance, nearest);
}
