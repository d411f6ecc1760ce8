// What is written alike for several widths. Before it, lanes16.h, lanes8.h and lanes4.h say what MM (the prefix of
// their intrinsics), BITS, FLOATS, BITS_AND and BITS_OR (whole numbers), COMPARED and COMPARED_IN are.
// No `#pragma once`: a generated kernel has the text of every width, each with its own of this file.

static inline vfloat v_splat(float a) {
    return MM(set1_ps)(a);
}

static inline vfloat v_load(const float from[LANES]) {
    return MM(loadu_ps)(from);
}

static inline void v_store(vfloat a, float to[LANES]) {
    MM(storeu_ps)(to, a);
}

static inline float v_lane0(vfloat a) {
    return MM(cvtss_f32)(a);
}

// A word of one, two or three operands that is an intrinsic.
#define WORD_1(type, name, of)                                                                     \
    static inline type name(type a) {                                                              \
        return MM(of)(a);                                                                          \
    }
#define WORD_2(type, name, of)                                                                     \
    static inline type name(type a, type b) {                                                      \
        return MM(of)(a, b);                                                                       \
    }
#define WORD_3(type, name, of)                                                                     \
    static inline type name(type a, type b, type c) {                                              \
        return MM(of)(a, b, c);                                                                    \
    }
WORD_1(vfloat, v_sqrt, sqrt_ps)
WORD_2(vfloat, v_min, min_ps)
WORD_2(vfloat, v_max, max_ps)
#if LANES != 4
WORD_1(vfloat, v_floor, floor_ps)
WORD_3(vfloat, v_madd, fmadd_ps)
WORD_3(vfloat, v_nmadd, fnmadd_ps)
WORD_3(vfloat, v_msub, fmsub_ps)
WORD_1(vhalf, v_half_sqrt, sqrt_pd)
WORD_1(vhalf, v_half_floor, floor_pd)
WORD_3(vhalf, v_half_madd, fmadd_pd)
WORD_3(vhalf, v_half_nmadd, fnmadd_pd)
#endif
#if LANES != 16
WORD_1(vfloat, v_rsqrt_approx, rsqrt_ps)
WORD_1(vfloat, v_rcp_approx, rcp_ps)
#endif
#undef WORD_1
#undef WORD_2
#undef WORD_3

#define COMPARISON(name, predicate)                                                                \
    static inline vmask v_cmp_##name(vfloat a, vfloat b) {                                         \
        return (vmask){COMPARED(name, predicate)};                                                 \
    }
COMPARISON(eq, _CMP_EQ_OQ)
COMPARISON(lt, _CMP_LT_OQ)
COMPARISON(le, _CMP_LE_OQ)
COMPARISON(gt, _CMP_GT_OQ)
COMPARISON(ge, _CMP_GE_OQ)
COMPARISON(nlt, _CMP_NLT_UQ)
COMPARISON(ngt, _CMP_NGT_UQ)
COMPARISON(nge, _CMP_NGE_UQ)
#undef COMPARISON

#if LANES != 16
static inline vmask v_signbit(vfloat a) {
    return (vmask){FLOATS(MM(srai_epi32)(BITS(a), 31))};
}

static inline vmask v_mask_none(void) {
    return (vmask){MM(setzero_ps)()};
}

static inline vmask v_mask_all(void) {
    return (vmask){FLOATS(MM(set1_epi32)(-1))};
}

static inline unsigned v_mask_bits(vmask a) {
    return (unsigned)MM(movemask_ps)(a.bits);
}

#define OF_MASKS(name, of)                                                                         \
    static inline vmask name(vmask a, vmask b) {                                                   \
        return (vmask){MM(of)(a.bits, b.bits)};                                                    \
    }
OF_MASKS(v_and, and_ps)
OF_MASKS(v_or, or_ps)
OF_MASKS(v_andnot, andnot_ps)
#undef OF_MASKS

static inline vfloat v_select_or_zero(vmask m, vfloat a) {
    return MM(and_ps)(m.bits, a);
}

static inline vfloat v_zero_where(vmask m, vfloat a) {
    return MM(andnot_ps)(m.bits, a);
}

static inline vfloat v_negate_where(vmask m, vfloat a) {
    return MM(xor_ps)(a, MM(and_ps)(m.bits, v_splat(-0.0f)));
}

static inline vfloat v_add_where(vmask m, vfloat a, vfloat b) {
    return a + v_select_or_zero(m, b);
}

static inline vfloat v_mantissa_near_1(vfloat a, vfloat *exponent) {
    vindex all = BITS(a);
    vindex steps = MM(srai_epi32)(MM(sub_epi32)(all, MM(set1_epi32)(0x3f400000)), 23);
    *exponent = MM(cvtepi32_ps)(steps);
    return FLOATS(MM(sub_epi32)(all, MM(slli_epi32)(steps, 23)));
}
#endif

// With 16 lanes one instruction each, which waits for no other mask to be joined with it.
#define COMPARISON_IN(name, predicate)                                                             \
    static inline vmask v_cmp_##name##_in(vmask m, vfloat a, vfloat b) {                           \
        return (vmask){COMPARED_IN(name, predicate)};                                              \
    }
COMPARISON_IN(lt, _CMP_LT_OQ)
COMPARISON_IN(gt, _CMP_GT_OQ)
COMPARISON_IN(ge, _CMP_GE_OQ)
COMPARISON_IN(nlt, _CMP_NLT_UQ)
COMPARISON_IN(ngt, _CMP_NGT_UQ)
COMPARISON_IN(nge, _CMP_NGE_UQ)
#undef COMPARISON_IN

static inline vfloat v_abs(vfloat a) {
    return MM(andnot_ps)(v_splat(-0.0f), a);
}

static inline vfloat v_copysign(vfloat a, vfloat from) {
    return MM(or_ps)(MM(and_ps)(v_splat(-0.0f), from), v_abs(a));
}

static inline vfloat v_exponent(vfloat a) {
    vindex field = MM(srli_epi32)(BITS(a), 23);
    return MM(cvtepi32_ps)(MM(sub_epi32)(field, MM(set1_epi32)(127)));
}

static inline vfloat v_mantissa(vfloat a) {
    vindex fraction = BITS_AND(BITS(a), MM(set1_epi32)(0x007fffff));
    return FLOATS(BITS_OR(fraction, MM(set1_epi32)(0x3f800000)));
}

static inline vfloat v_ldexp(vfloat a, vfloat n) {
    vindex power = MM(slli_epi32)(MM(cvtps_epi32)(n), 23);
    return FLOATS(MM(add_epi32)(BITS(a), power));
}

static inline vfloat v_pow2_unit(vfloat a) {
    vindex field = BITS_AND(BITS(a), MM(set1_epi32)(0x7f800000));
    return FLOATS(MM(sub_epi32)(MM(set1_epi32)(0x7f000000), field));
}

#if LANES != 4
static inline vhalf v_half_splat(double a) {
    return MM(set1_pd)(a);
}

static inline void v_store_or_stream(float *to, bool stream, vfloat a) {
    if (!stream)
        MM(storeu_ps)(to, a);
    else
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__ // they do not see a streaming store
        *(vfloat *)to = a;
#else
        MM(stream_ps)(to, a);
#endif
}
#endif
