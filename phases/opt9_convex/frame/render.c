// The phase's entry points, and the choice between the kernels for 8 and for 16 lanes: the same sources
// ("each_variant" of phase.json), built twice.
#include <stdalign.h>
#include <stdlib.h>

#include "frame/draw_path.h"
#include "frame/prepare.h"

// The memory behind a struct prepared: the caller's pointer is to its first member.
struct phase_state {
    struct prepared prepared;
    struct workers *workers;
    const struct lane_kernel *lanes;
};

const char *phase_unsupported(const struct scene *scene) {
    return draw_path_unsupported(scene);
}

const char *phase_settings(const struct prepared *prepared) {
    return draw_path_setting(prepared->path);
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    prepare_shapes(prepared, model);
    return true;
}

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct phase_state *kept = calloc(1, sizeof *kept);
    if (!kept)
        return NULL;
    kept->lanes = lanes_here();
    kept->prepared.path = draw_path_forced();
    if (reserve_prepared(&kept->prepared, model)) {
        prepare_shapes(&kept->prepared, model);
        kept->workers = workers_start(threads, kept->lanes->scratch_size(model));
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
    free_prepared(prepared);
    free(kept);
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    const struct phase_state *kept = (const struct phase_state *)prepared; // its first member
    bool analytic = prepared->analytic && set_local_cameras(prepared, view, kept->lanes);
    int high = tile_height(prepared, frame->height);
    // All workers read it.
    alignas(WORKERS_APART) struct job job = {prepared, view,     frame, prepared->cameras,
                                             high,     analytic, NULL};
    workers_run(kept->workers, kept->lanes->tile, &job, kept->lanes->tiles(&job));
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct phase_state *kept = (const struct phase_state *)prepared; // its first member
    return kept->lanes->distances(prepared, count, points, distance, nearest);
}
