// The phase's entry points, and the choice between the kernels for 8 and for 16 lanes. Both are built from the files
// of each_variant in phase.json.
#include <stdalign.h>
#include <stdlib.h>

#include "core/kernel.h"
#include "core/primitives.h"
#include "driver/variant.h"
#include "workers/workers.h"

// The march reads `prepared`. The workers stand behind it.
struct phase_state {
    struct prepared prepared;
    struct workers *workers;
    bool sixteen; // 16 lanes, else 8
};

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct phase_state *state = calloc(1, sizeof *state);
    if (!state)
        return NULL;
    if (shapes_reserve(&state->prepared, model)) {
        state->sixteen = variant_here().lanes == 16;
        state->workers = workers_start(threads, state->sixteen ? lanes16_scratch_size(model)
                                                               : lanes8_scratch_size(model));
    }
    if (!state->workers) {
        shapes_release(&state->prepared);
        free(state);
        return NULL;
    }
    phase_update(&state->prepared, model);
    return &state->prepared;
}

void phase_release(struct prepared *prepared) {
    struct phase_state *state = (struct phase_state *)prepared; // its first member
    workers_end(state->workers);
    shapes_release(prepared);
    free(state);
}

// All workers read it, so it has cache lines of its own.
struct frame_job {
    alignas(WORKERS_APART) struct job job;
    bool sixteen;
};

static void render_tile(const void *data, int tile, void *scratch) {
    const struct frame_job *job = data;
    if (job->sixteen)
        lanes16_tile(&job->job, tile, scratch);
    else
        lanes8_tile(&job->job, tile, scratch);
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    const struct phase_state *state = (const struct phase_state *)prepared; // its first member
    struct frame_job job = {{prepared, view, frame}, state->sixteen};
    workers_run(state->workers, render_tile, &job,
                state->sixteen ? lanes16_tiles(frame) : lanes8_tiles(frame));
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct phase_state *state = (const struct phase_state *)prepared; // its first member
    return state->sixteen ? lanes16_distances(prepared, count, points, distance, nearest)
                          : lanes8_distances(prepared, count, points, distance, nearest);
}
