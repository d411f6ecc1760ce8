// Packets of vectors from and to arrays of rays.
#pragma once

#include "simd/simd.h"
#include "trace.h"

static inline struct vec load_vec(const float *const from[3], int i) {
    return (struct vec){v_load(from[0] + i), v_load(from[1] + i), v_load(from[2] + i)};
}

static inline void store_vec(struct vec a, float (*to)[ROOM], int i) {
    v_store(a.x, to[0] + i);
    v_store(a.y, to[1] + i);
    v_store(a.z, to[2] + i);
}

// Stores the lanes in m one behind the other.
static inline void pack_vec(vmask m, struct vec a, float (*to)[ROOM], int i) {
    v_compress_store(m, a.x, to[0] + i);
    v_compress_store(m, a.y, to[1] + i);
    v_compress_store(m, a.z, to[2] + i);
}
