// The state of a packet's march, and what march/march.c and march/march_plane.c call of each other.
#ifndef MARCH_STATE_H
#define MARCH_STATE_H

#include "core/trace.h"

// Where the rays of a packet are: at the distance before + t + last. t and the last step are kept apart, because
// their rounded sum would lose the digits that place the hit on the surface.
struct march_state {
    struct point origin; // at the distance `before`
    vfloat before, t, last, evals;
    vfloat start; // t of the next evaluation
    vmask found;
    struct bounds_exit exit;
    int left;   // steps that every ray still has before its cap
    vmask deep; // a ray that started inside a shape has stepped back out of it
    vmask
        told; // bulb/bulb_single.c has found the hit, more exactly than land_hits() could check it
    vfloat inside; // the number of the shape that a ray of `deep` was in; else −1
    struct hit_surroundings near;
};

// Ends the rays of packet k that have left `going` (they have reached a surface) or `inside` (they have left the
// bounds), and those that have used up their steps. `step` counts from 1. Each ray has a cap of its own, so its
// neighbours in the packet do not matter.
void end_rays(struct march_state *at, int step, int k, vmask going, vmask inside,
              struct packet_group *group, int cap);

// Marches all packets of the group to the end, where the plane `shape` is the only shape that the rays can hit. `next`
// is the number of the first step.
void march_to_plane(struct march_state packets[GROUP], int shape, int next,
                    struct packet_group *group, const struct model *model);

// Whether every live ray hits the plane `alone->shape` before any other shape can wake.
bool plane_is_sole_hit(const struct packet_group *group, const struct sole_shape *alone);

#endif
