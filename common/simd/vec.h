// Vectors of several rays at once: three vfloats, a structure of arrays. Fused multiply-adds are written out,
// because contraction is off (-ffp-contract=off).
#ifndef SIMD_VEC_H
#define SIMD_VEC_H

#include "simd/simd.h"

struct vec {
    vfloat x, y, z;
};

static inline struct vec vec_set(const float *a) {
    return (struct vec){v_splat(a[0]), v_splat(a[1]), v_splat(a[2])};
}

static inline struct vec vec_from_doubles(const double a[3]) {
    return (struct vec){v_splat((float)a[0]), v_splat((float)a[1]), v_splat((float)a[2])};
}

static inline vfloat vec_dot(struct vec a, struct vec b) {
    return v_madd(a.x, b.x, v_madd(a.y, b.y, a.z * b.z));
}

static inline vfloat vec_norm(struct vec a) {
    return v_sqrt(vec_dot(a, a));
}

static inline struct vec vec_scale(struct vec a, vfloat s) {
    return (struct vec){a.x * s, a.y * s, a.z * s};
}

// The points at distance t along the rays.
static inline struct vec vec_along(struct vec origin, struct vec direction, vfloat t) {
    return (struct vec){v_madd(direction.x, t, origin.x), v_madd(direction.y, t, origin.y),
                        v_madd(direction.z, t, origin.z)};
}

static inline struct vec vec_select(vmask m, struct vec yes, struct vec no) {
    return (struct vec){v_select(m, yes.x, no.x), v_select(m, yes.y, no.y),
                        v_select(m, yes.z, no.z)};
}

// d mirrored at the plane with unit normal n.
static inline struct vec vec_reflect(struct vec d, struct vec n) {
    return vec_along(d, n, v_splat(-2.0f) * vec_dot(d, n));
}

#endif
