// Float arithmetic in lanes, in place of fixed_simd's fixed point: tile.c is the same. A float has its own exponent, so
// a shift that brings a fixed-point product back to the format does nothing here. Lengths are in scene units.
// The words are those of systems/fixed/number/number.h. v_dot is of fused products; v_cmp_lt and v_positive are false
// for NaN.
#pragma once

#include <stdbool.h>

#include "number/format.h"
#include "simd/simd.h"

typedef vfloat vnum;

static inline vnum v_add(vnum a, vnum b) {
    return a + b;
}

static inline vnum v_sub(vnum a, vnum b) {
    return a - b;
}

static inline vnum v_mul_wide(vnum a, vnum b) {
    return a * b;
}

static inline bool v_mask_lane(vmask a, int lane) {
    return v_mask_bits(a) >> lane & 1;
}

static inline vmask v_positive(vnum a) {
    return v_cmp_lt(v_splat(0), a);
}

#if LANES == 16
static inline vindex v_whole(vnum a) {
    return _mm512_cvtps_epi32(a);
}
#elif defined __x86_64__
static inline vindex v_whole(vnum a) {
    return _mm256_cvtps_epi32(a);
}
#endif // NEON's is common/simd's

static inline vnum v_lookup(const float *table, vnum at) {
    return v_gather(table, v_whole(at));
}

static inline vmask v_test_bit(vnum a, int k) {
#if LANES == 16
    return (vmask){_mm512_test_epi32_mask(v_whole(a), _mm512_set1_epi32(1 << k))};
#elif defined __aarch64__
    return (vmask){(v_whole(a) & 1 << k) != 0};
#else
    const __m256i bit = _mm256_set1_epi32(1 << k);
    return (vmask){_mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(v_whole(a), bit), bit))};
#endif
}

static inline void v_store_float(vnum a, double scale, float to[LANES]) {
    v_store(a * v_splat((float)scale), to);
}

static inline void v_store_double(vnum a, double scale, double to[LANES]) {
    float lanes[LANES];
    v_store(a, lanes);
    for (int lane = 0; lane < LANES; lane++)
        to[lane] = lanes[lane] * scale;
}

static const float LARGEST_FACTOR = 0x1p31f; // fixed point's, so that both limit brightness alike

static inline vnum v_sra(vnum a, int by) {
    (void)by;
    return a;
}

static inline vnum v_mul(vnum a, vnum b, const struct format *f) {
    (void)f;
    return a * b;
}

static inline vnum v_dot(struct vec a, struct vec b, const struct format *f) {
    (void)f;
    return v_madd(a.z, b.z, v_madd(a.y, b.y, a.x * b.x));
}

static inline vnum v_root(vnum a, const struct format *f) {
    (void)f;
    return v_sqrt(a);
}

struct reciprocal {
    vnum factor;
};

static inline vnum times_reciprocal(vnum a, struct reciprocal r) {
    return a * r.factor;
}

// Returns v/|v|, and 1/|v| in `length`, correctly rounded root and quotient. |v|² is taken as at least 1e-30.
static inline struct vec normalize(struct vec v, const struct format *f,
                                   struct reciprocal *length) {
    vnum square = v_dot(v, v, f), least = v_splat(1e-30f);
    vnum x = v_splat(1) / v_sqrt(v_select(v_cmp_lt(square, least), least, square));
    length->factor = x;
    return (struct vec){v.x * x, v.y * x, v.z * x};
}
