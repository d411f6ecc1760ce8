// What this phase computes with besides common/simd: reductions, with their costs.
#ifndef PACKETS_NUMERICS_H
#define PACKETS_NUMERICS_H

#include "simd/simd.h"

// The least and the most of all lanes.
static inline float least_lane(vfloat a) {
    COUNT(least_lane, call);
    return v_reduce_min(a);
}

static inline float most_lane(vfloat a) {
    COUNT(most_lane, call);
    return v_reduce_max(a);
}

#endif
