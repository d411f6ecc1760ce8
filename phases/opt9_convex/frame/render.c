// The phase's entry points, and the choice between the kernels for 8 and for 16 lanes: the same sources
// ("each_variant" of phase.json), built twice.
#include <stdalign.h>
#include <stdlib.h>

#include "driver/variant.h"
#include "frame/draw_path.h"
#include "frame/prepare.h"
#include "phase.h"
#include "workers/workers.h"

// The memory behind a struct prepared: the caller's pointer is to its first member.
struct phase_state {
    struct prepared prepared;
    struct workers *workers;
    bool sixteen; // 16 lanes, else 8
};

const char *phase_unsupported(const struct scene *scene) {
    return draw_path_unsupported(scene, variant_here().lanes == 16);
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
    kept->sixteen = variant_here().lanes == 16;
    kept->prepared.path = draw_path_forced();
    if (reserve_prepared(&kept->prepared, model)) {
        prepare_shapes(&kept->prepared, model);
        kept->workers = workers_start(threads, kept->sixteen ? lanes16_scratch_size(model)
                                                             : lanes8_scratch_size(model));
    }
    if (!kept->workers) {
        free_prepared(&kept->prepared);
        free(kept);
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

// Aligned away from what the caller writes on its stack, because all workers read it.
struct frame_job {
    alignas(WORKERS_APART) struct job job;
    bool sixteen;
};

static void render_tile(const void *data, int tile, void *memory) {
    const struct frame_job *job = data;
    if (job->sixteen)
        lanes16_tile(&job->job, tile, memory);
    else
        lanes8_tile(&job->job, tile, memory);
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    const struct phase_state *kept = (const struct phase_state *)prepared; // its first member
    struct frame_job job = {
        {prepared, view, frame, prepared->cameras, tile_height(prepared, frame->height),
         prepared->analytic && set_local_cameras(prepared, view, kept->sixteen), NULL},
        kept->sixteen};
    workers_run(kept->workers, render_tile, &job,
                kept->sixteen ? lanes16_tiles(&job.job) : lanes8_tiles(&job.job));
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct phase_state *kept = (const struct phase_state *)prepared; // its first member
    return kept->sixteen ? lanes16_distances(prepared, count, points, distance, nearest)
                         : lanes8_distances(prepared, count, points, distance, nearest);
}
