// Vectors of several rays at once: three registers, a structure of arrays. Included where vreal, a number in each lane,
// has its words: floats by simd/vectors.h and opt4, doubles by opt3.
#pragma once

struct vec {
    vreal x, y, z;
};

static inline vreal vec_dot(struct vec a, struct vec b) {
    return v_madd(a.x, b.x, v_madd(a.y, b.y, a.z * b.z));
}

static inline vreal vec_norm(struct vec a) {
    return v_sqrt(vec_dot(a, a));
}

static inline struct vec vec_scale(struct vec a, vreal s) {
    return (struct vec){a.x * s, a.y * s, a.z * s};
}

// The points at distance t along the rays.
static inline struct vec vec_along(struct vec origin, struct vec direction, vreal t) {
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

// A point as the unevaluated sum of two floats, hi + lo: about 48 bits per coordinate.
struct point {
    struct vec hi, lo;
};

// a + b and its rounding error, exactly: T. J. Dekker, "A floating-point technique for extending the
// available precision", Numer. Math. 18 (1971); D. E. Knuth, TAOCP vol. 2, 4.2.2.
static inline vreal v_two_sum(vreal a, vreal b, vreal *error) {
    vreal sum = a + b, b_part = sum - a;
    *error = (a - (sum - b_part)) + (b - b_part);
    return sum;
}

// One coordinate of the point at distance t + dt along a ray. Every rounding error but the last is carried into lo, as
// v_msub rounds once.
static inline vreal point_along(vreal hi, vreal *lo, vreal direction, vreal t, vreal dt) {
    vreal product = direction * t, product_error = v_msub(direction, t, product), sum_error;
    vreal sum = v_two_sum(hi, product, &sum_error);
    vreal tail = v_madd(direction, dt, product_error + (sum_error + *lo));
    vreal result = sum + tail;
    *lo = tail - (result - sum);
    return result;
}
