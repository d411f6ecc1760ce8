// The entry points of opt2 to opt4 before the first frame and after the last. Included by the phase's
// source, after its struct prepared. A phase that keeps more of each shape, behind the instructions,
// defines MORE_PER_SHAPE before: how many bytes.
#pragma once

#include <stdlib.h>

#ifndef MORE_PER_SHAPE
#define MORE_PER_SHAPE 0
#endif

struct prepared *phase_prepare(const struct model *model, int threads) {
    (void)threads; // one
    size_t shapes = (size_t)model->shape_count, nodes = (size_t)model->node_count;
    struct prepared *prepared =
        calloc(1, sizeof *prepared + shapes * (sizeof *prepared->primitives + MORE_PER_SHAPE) +
                      nodes * INSTRUCTIONS_PER_NODE * sizeof *prepared->instructions);
    if (!prepared)
        return NULL;
    prepared->primitives = (struct primitive *)(prepared + 1);
    prepared->instructions = (struct instruction *)(prepared->primitives + shapes);
    phase_update(prepared, model);
    return prepared;
}

void phase_release(struct prepared *prepared) {
    free(prepared);
}
