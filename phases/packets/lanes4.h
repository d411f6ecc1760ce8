// Four lanes: SSE2, which every x86-64 has. See lanes.h.
#ifndef PACKETS_LANES4_H
#define PACKETS_LANES4_H

typedef __m128 real;
typedef struct {
    __m128 all; // all bits of a lane set, or none
} mask;

static inline real set(float a) {
    return _mm_set1_ps(a);
}

static inline real load(const float from[LANES]) {
    return _mm_loadu_ps(from);
}

static inline void unload(real a, float to[LANES]) {
    _mm_storeu_ps(to, a);
}

static inline float first_of(real a) {
    return _mm_cvtss_f32(a);
}

static inline real lane_numbers(void) {
    return _mm_setr_ps(0, 1, 2, 3);
}

static inline mask less(real a, real b) {
    return (mask){_mm_cmplt_ps(a, b)};
}

static inline mask greater(real a, real b) {
    return (mask){_mm_cmpgt_ps(a, b)};
}

static inline mask not_less(real a, real b) {
    return (mask){_mm_cmpge_ps(a, b)};
}

static inline mask equal(real a, real b) {
    return (mask){_mm_cmpeq_ps(a, b)};
}

static inline mask no_lane(void) {
    return (mask){_mm_setzero_ps()};
}

static inline mask lanes_of(unsigned which) {
    const __m128i one = _mm_setr_epi32(1, 2, 4, 8);
    __m128i its = _mm_and_si128(_mm_set1_epi32((int)which), one);
    return (mask){_mm_castsi128_ps(_mm_cmpeq_epi32(its, one))};
}

static inline mask both(mask a, mask b) {
    return (mask){_mm_and_ps(a.all, b.all)};
}

static inline mask either(mask a, mask b) {
    return (mask){_mm_or_ps(a.all, b.all)};
}

static inline mask but_not(mask a, mask b) {
    return (mask){_mm_andnot_ps(a.all, b.all)};
}

static inline unsigned bits(mask a) {
    return (unsigned)_mm_movemask_ps(a.all);
}

static inline real choose(mask m, real yes, real no) {
    return _mm_or_ps(_mm_and_ps(m.all, yes), _mm_andnot_ps(m.all, no));
}

static inline real keep(mask m, real a) {
    return _mm_and_ps(m.all, a);
}

static inline real negate_where(mask m, real a) {
    return _mm_xor_ps(a, _mm_and_ps(m.all, set(-0.0f)));
}

static inline real least_of(real a, real b) {
    return _mm_min_ps(a, b);
}

static inline real most_of(real a, real b) {
    return _mm_max_ps(a, b);
}

static inline float least_lane(real a) {
    COUNT(least_lane, call);
    a = _mm_min_ps(a, _mm_movehl_ps(a, a));
    return _mm_cvtss_f32(_mm_min_ss(a, _mm_shuffle_ps(a, a, 1)));
}

static inline float most_lane(real a) {
    COUNT(most_lane, call);
    a = _mm_max_ps(a, _mm_movehl_ps(a, a));
    return _mm_cvtss_f32(_mm_max_ss(a, _mm_shuffle_ps(a, a, 1)));
}

static inline real absolute(real a) {
    return _mm_andnot_ps(set(-0.0f), a);
}

static inline real with_sign_of(real from, real a) {
    return _mm_or_ps(_mm_and_ps(set(-0.0f), from), absolute(a));
}

static inline real root(real a) {
    return _mm_sqrt_ps(a);
}

static inline real mul_add(real a, real b, real c) {
    return a * b + c;
}

static inline real neg_mul_add(real a, real b, real c) {
    return c - a * b;
}

static inline real mul_sub(real a, real b, real c) {
    return a * b - c;
}

static inline real newton_inverse_root(real a) {
    real r = _mm_rsqrt_ps(a);
    return r * neg_mul_add(a * r, r * set(0.5f), set(1.5f));
}

static inline real whole_near(real a) {
    return _mm_cvtepi32_ps(_mm_cvtps_epi32(a));
}

static inline real exponent_of(real a) {
    __m128i field = _mm_srli_epi32(_mm_castps_si128(a), 23);
    return _mm_cvtepi32_ps(_mm_sub_epi32(field, _mm_set1_epi32(127)));
}

static inline real mantissa_of(real a) {
    __m128i fraction = _mm_and_si128(_mm_castps_si128(a), _mm_set1_epi32(0x007fffff));
    return _mm_castsi128_ps(_mm_or_si128(fraction, _mm_set1_epi32(0x3f800000)));
}

static inline real scaled(real a, real n) {
    __m128i power = _mm_slli_epi32(_mm_cvtps_epi32(n), 23);
    return _mm_castsi128_ps(_mm_add_epi32(_mm_castps_si128(a), power));
}

static inline void pack(mask m, real a, float to[LANES]) {
    float lanes[LANES];
    unload(a, lanes);
    for (unsigned rest = bits(m); rest; rest &= rest - 1)
        *to++ = lanes[__builtin_ctz(rest)];
}

#endif
