// The phase's entry points, and the choice between the kernels for 8 and for 16 lanes. Both are built from the files
// of each_variant in phase.json.
#include <stdalign.h>
#include <stdlib.h>

#include "core/kernel.h"
#include "core/primitives.h"

// The march reads `prepared`. The workers stand behind it.
struct phase_state {
    struct prepared prepared;
    struct workers *workers;
    const struct lane_kernel *kernel;
};

struct prepared *phase_prepare(const struct model *model, int threads) {
    struct phase_state *state = calloc(1, sizeof *state);
    if (!state)
        return NULL;
    if (shapes_reserve(&state->prepared, model)) {
        state->kernel = lanes_here();
        state->workers = workers_start(threads, state->kernel->scratch_size(model));
    }
    if (!state->workers) {
        phase_release(&state->prepared);
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

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    const struct phase_state *state = (const struct phase_state *)prepared; // its first member
    // All workers read it.
    alignas(WORKERS_APART) struct job job = {prepared, view, frame};
    workers_run(state->workers, state->kernel->tile, &job, state->kernel->tiles(&job));
    return true;
}

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    const struct phase_state *state = (const struct phase_state *)prepared; // its first member
    return state->kernel->distances(prepared, count, points, distance, nearest);
}
