// Vectors are arrays of three doubles and their operations are inlined: nothing is copied, and the
// compiler sees which components are used.
#pragma once

#include <math.h>

#include "counting/flops.h"

static inline void vec_set(const double *a, double *out) {
    for (int i = 0; i < 3; i++)
        out[i] = a[i];
}

static inline void vec_scale(const double *a, double s, double *out) {
    for (int i = 0; i < 3; i++)
        out[i] = a[i] * s;
}

// The point at distance t along a ray.
static inline void vec_along(const double *origin, const double *direction, double t, double *out) {
    for (int i = 0; i < 3; i++)
        out[i] = origin[i] + direction[i] * t;
}

static inline double vec_dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double vec_norm_sq(const double *a) {
    return vec_dot(a, a);
}

static inline double vec_norm(const double *a) {
    return sqrt(vec_norm_sq(a));
}

// d reflected at the plane with unit normal n.
static inline void vec_reflect(const double *d, const double *n, double *out) {
    vec_along(d, n, -2.0 * vec_dot(d, n), out);
}
