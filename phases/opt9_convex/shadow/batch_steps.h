// What the files of the marches in batches share: the order of the rays, the moves between packets, and the first steps.
#ifndef OPT9_BATCH_STEPS_H
#define OPT9_BATCH_STEPS_H

#include "shadow/shadow_batch.h"

// Steps between two cone queries, in an active set or away from the rays' own solid.
enum { CHECK_INTERVAL = 6 };

// Sorts the queued rays into scratch->order[0]: rays from one solid follow one another in the BVH's order, and rays from
// planes come last, in Morton order.
void sort_shadow_rays(struct worker_scratch *scratch, const struct prepared *scene);
// Returns where the batch ends that begins at place `first` of the sorted queue.
int batch_end(const struct worker_scratch *scratch, int first);

// One cone query for the first packets of a batch. A ray ends if its cone meets no shape further on.
void query_ahead(struct shadow_batch *batch, int packets, const struct tile_context *work);
// Writes the light that reaches the rays in `done` to the queue.
void store_lit(const struct walk *w, vmask done, struct worker_scratch *scratch);
// Moves the rays into as few packets as hold them: first the rays that march, behind them the rays that wait. Rays that have
// ended are stored and left out. Returns whether any ray has moved.
bool compact_packets(struct shadow_batch *batch, struct worker_scratch *scratch);

// Marches the rays from a solid, as long as no other shape can be nearer than that solid.
void leave_own_solid(struct shadow_batch *batch, vfloat strength, vfloat hit,
                     const struct tile_context *work);

// One step of all rays except those in `still`. `settled`: no term of this step can be the least.
static inline void step_others(struct shadow_march *m, vmask still, vfloat h, vfloat strength,
                               vfloat hit, bool settled) {
    vfloat previous = m->previous, from = m->from;
    m->done = still;
    ACTIVE(LANES - v_count(still));
    if (settled)
        advance_by(m, h, off_surfaces(m, h, hit));
    else
        shadow_step(m, h, strength, hit, 0.0f);
    m->previous = v_select(still, previous, m->previous);
    m->from = v_select(still, from, m->from);
}

#endif
