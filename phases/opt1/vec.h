// Vectors by pointer: an operation reads its operands in place and writes its result in place, without
// copies through the stack. The operations are still calls, as in the paper's phase 1.
#pragma once

#include <math.h>

#include "counting/flops.h"

// A call must stay a call, as in baseline: this phase changes how arguments are passed, not what is
// inlined. gcc would still clone a noinline function for its arguments, which noipa forbids.
#ifdef __clang__
#define CALL __attribute__((noinline, unused)) static
#else
#define CALL __attribute__((noipa, unused)) static
#endif

struct vec3 {
    double x, y, z;
};

CALL void vec_add(const struct vec3 *a, const struct vec3 *b, struct vec3 *out) {
    COUNT(vec_add, call);
    out->x = a->x + b->x;
    out->y = a->y + b->y;
    out->z = a->z + b->z;
}

CALL void vec_sub(const struct vec3 *a, const struct vec3 *b, struct vec3 *out) {
    COUNT(vec_sub, call);
    out->x = a->x - b->x;
    out->y = a->y - b->y;
    out->z = a->z - b->z;
}

CALL void vec_mult(const struct vec3 *a, const struct vec3 *b, struct vec3 *out) {
    COUNT(vec_mult, call);
    out->x = a->x * b->x;
    out->y = a->y * b->y;
    out->z = a->z * b->z;
}

CALL void vec_scale(const struct vec3 *a, double s, struct vec3 *out) {
    COUNT(vec_scale, call);
    out->x = a->x * s;
    out->y = a->y * s;
    out->z = a->z * s;
}

// The point at distance t along a ray.
CALL void vec_along(const struct vec3 *origin, const struct vec3 *direction, double t,
                    struct vec3 *out) {
    COUNT(vec_along, call);
    out->x = origin->x + direction->x * t;
    out->y = origin->y + direction->y * t;
    out->z = origin->z + direction->z * t;
}

CALL void vec_abs(const struct vec3 *a, struct vec3 *out) {
    COUNT(vec_abs, call);
    out->x = fabs(a->x);
    out->y = fabs(a->y);
    out->z = fabs(a->z);
}

CALL double vec_dot(const struct vec3 *a, const struct vec3 *b) {
    COUNT(vec_dot, call);
    return a->x * b->x + a->y * b->y + a->z * b->z;
}

CALL double vec_norm(const struct vec3 *a) {
    COUNT(vec_norm, call);
    return sqrt(a->x * a->x + a->y * a->y + a->z * a->z);
}

CALL void vec_normalize(const struct vec3 *a, struct vec3 *out) {
    COUNT(vec_normalize, call);
    vec_scale(a, 1.0 / vec_norm(a), out);
}

// d reflected at the plane with unit normal n.
CALL void vec_reflect(const struct vec3 *d, const struct vec3 *n, struct vec3 *out) {
    COUNT(vec_reflect, call);
    struct vec3 twice;
    vec_scale(n, 2.0 * vec_dot(d, n), &twice);
    vec_sub(d, &twice, out);
}
