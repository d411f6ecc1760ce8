// Four and eight lanes on aarch64: one or two registers of NEON. See simd.h. What C can say of vectors (+ & and
// shifts), the compiler splits into registers. For the rest v_split() gives the registers of a word and v_join() takes
// them. frsqrte and frecpe tell 8 bits, a step by Newton's method doubles them. gcc 12 keeps eight lanes that live from
// one turn of a loop to the next in memory, clang in registers.
// No `#pragma once`: see words.h.

typedef float vfloat __attribute__((vector_size(4 * LANES), may_alias));
typedef int vindex
    __attribute__((vector_size(4 * LANES), may_alias)); // a whole number in each lane
typedef unsigned vbits __attribute__((vector_size(4 * LANES), may_alias));
typedef struct {
    vindex bits; // all bits of a lane set, or none
} vmask;
typedef struct {
    float32x4_t of[LANES / 4];
} vregisters;

#define BITS(a) ((vindex)(a))
#define FLOATS(a) ((vfloat)(a))
#define EACH_REGISTER(i) for (int i = 0; i < LANES / 4; i++)
#if LANES == 4
#define V_ALL(a) {a, a, a, a}
#else
#define V_ALL(a) {a, a, a, a, a, a, a, a}
#endif

static inline vregisters v_split(vfloat a) {
    vregisters x;
    __builtin_memcpy(&x, &a, sizeof x);
    return x;
}

static inline vfloat v_join(vregisters x) {
    vfloat a;
    __builtin_memcpy(&a, &x, sizeof a);
    return a;
}

#define BY_REGISTER_1(name, expression)                                                            \
    static inline vfloat name(vfloat a) {                                                          \
        vregisters x = v_split(a);                                                                 \
        EACH_REGISTER(i) {                                                                         \
            float32x4_t q = x.of[i];                                                               \
            x.of[i] = expression;                                                                  \
        }                                                                                          \
        return v_join(x);                                                                          \
    }
#define BY_REGISTER_2(name, word)                                                                  \
    static inline vfloat name(vfloat a, vfloat b) {                                                \
        vregisters x = v_split(a), y = v_split(b);                                                 \
        EACH_REGISTER(i) {                                                                         \
            x.of[i] = word(x.of[i], y.of[i]);                                                      \
        }                                                                                          \
        return v_join(x);                                                                          \
    }
#define BY_REGISTER_3(name, expression)                                                            \
    static inline vfloat name(vfloat a, vfloat b, vfloat c) {                                      \
        vregisters x = v_split(a), y = v_split(b), z = v_split(c);                                 \
        EACH_REGISTER(i) {                                                                         \
            float32x4_t p = x.of[i], q = y.of[i], r = z.of[i];                                     \
            z.of[i] = expression;                                                                  \
        }                                                                                          \
        return v_join(z);                                                                          \
    }

// In a step for 0 or infinity a product of both is NaN; as with x86, 1/sqrt(0) is infinity and 1/sqrt(infinity) 0.
static inline float32x4_t rsqrt_register(float32x4_t a) {
    float32x4_t r = vrsqrteq_f32(a);
    return vmulq_f32(r, vminnmq_f32(vrsqrtsq_f32(vmulq_f32(a, r), r), vdupq_n_f32(1.5f)));
}

// At least 1/2: for denormals r is infinity, and the step would turn its sign.
static inline float32x4_t rcp_register(float32x4_t a) {
    float32x4_t r = vrecpeq_f32(a);
    return vmulq_f32(r, vmaxq_f32(vrecpsq_f32(a, r), vdupq_n_f32(0.5f)));
}

// Not fmin and fmax, which take the number beside a NaN and the lesser of two zeros.
static inline float32x4_t min_register(float32x4_t a, float32x4_t b) {
    return vbslq_f32(vcltq_f32(a, b), a, b);
}

static inline float32x4_t max_register(float32x4_t a, float32x4_t b) {
    return vbslq_f32(vcgtq_f32(a, b), a, b);
}

BY_REGISTER_1(v_sqrt, vsqrtq_f32(q))
BY_REGISTER_1(v_floor, vrndmq_f32(q))
BY_REGISTER_1(v_round, vrndnq_f32(q))
BY_REGISTER_1(v_rsqrt_approx, rsqrt_register(q))
BY_REGISTER_1(v_rcp_approx, rcp_register(q))
BY_REGISTER_2(v_min, min_register)
BY_REGISTER_2(v_max, max_register)
BY_REGISTER_3(v_madd, vfmaq_f32(r, p, q))
BY_REGISTER_3(v_nmadd, vfmsq_f32(r, p, q))
BY_REGISTER_3(v_msub, vfmaq_f32(vnegq_f32(r), p, q))

static inline vfloat v_splat(float a) {
    return (vfloat)V_ALL(a);
}

// Vectors of any alignment.
typedef float unaligned_vfloat __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
typedef int unaligned_vindex __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

static inline vfloat v_load(const float from[LANES]) {
    return *(const unaligned_vfloat *)from;
}

static inline void v_store(vfloat a, float to[LANES]) {
    *(unaligned_vfloat *)to = a;
}

static inline float v_lane0(vfloat a) {
    return a[0];
}

static inline vfloat v_iota(void) {
#if LANES == 4
    return (vfloat){0, 1, 2, 3};
#else
    return (vfloat){0, 1, 2, 3, 4, 5, 6, 7};
#endif
}

static inline vmask v_and(vmask a, vmask b) {
    return (vmask){a.bits & b.bits};
}

static inline vmask v_or(vmask a, vmask b) {
    return (vmask){a.bits | b.bits};
}

static inline vmask v_andnot(vmask a, vmask b) {
    return (vmask){~a.bits & b.bits};
}

// By registers: gcc would compare wider vectors lane by lane.
#define COMPARISON(name, word, opposite)                                                           \
    static inline vmask v_cmp_##name(vfloat a, vfloat b) {                                         \
        vregisters x = v_split(a), y = v_split(b);                                                 \
        EACH_REGISTER(i) {                                                                         \
            x.of[i] = vreinterpretq_f32_u32(opposite(word(x.of[i], y.of[i])));                     \
        }                                                                                          \
        return (vmask){BITS(v_join(x))};                                                           \
    }                                                                                              \
    static inline vmask v_cmp_##name##_in(vmask m, vfloat a, vfloat b) {                           \
        return v_and(m, v_cmp_##name(a, b));                                                       \
    }
COMPARISON(eq, vceqq_f32, )
COMPARISON(lt, vcltq_f32, )
COMPARISON(le, vcleq_f32, )
COMPARISON(gt, vcgtq_f32, )
COMPARISON(ge, vcgeq_f32, )
COMPARISON(nlt, vcltq_f32, vmvnq_u32)
COMPARISON(ngt, vcgtq_f32, vmvnq_u32)
COMPARISON(nge, vcgeq_f32, vmvnq_u32)
#undef COMPARISON

static inline vmask v_signbit(vfloat a) {
    return (vmask){BITS(a) >> 31};
}

static inline vmask v_mask_none(void) {
    return (vmask){(vindex)V_ALL(0)};
}

static inline vmask v_mask_all(void) {
    return (vmask){(vindex)V_ALL(-1)};
}

static inline vindex v_bit_of_lane(void) {
#if LANES == 4
    return (vindex){1, 2, 4, 8};
#else
    return (vindex){1, 2, 4, 8, 16, 32, 64, 128};
#endif
}

static inline unsigned v_mask_bits(vmask a) {
    vregisters x = v_split(FLOATS(a.bits & v_bit_of_lane()));
    uint32x4_t sum = vreinterpretq_u32_f32(x.of[0]);
    for (int i = 1; i < LANES / 4; i++)
        sum = vorrq_u32(sum, vreinterpretq_u32_f32(x.of[i]));
    return vaddvq_u32(sum);
}

static inline bool v_any(vmask a) {
    vregisters x = v_split(FLOATS(a.bits));
    uint32x4_t any = vreinterpretq_u32_f32(x.of[0]);
    for (int i = 1; i < LANES / 4; i++)
        any = vorrq_u32(any, vreinterpretq_u32_f32(x.of[i]));
    return vmaxvq_u32(any) != 0;
}

static inline bool v_all(vmask a) {
    return !v_any((vmask){~a.bits});
}

static inline vmask v_mask_of_bits(unsigned which) {
    vindex all = V_ALL((int)which);
    vregisters x = v_split(FLOATS(all & v_bit_of_lane()));
    EACH_REGISTER(i) {
        uint32x4_t bit = vreinterpretq_u32_f32(x.of[i]);
        x.of[i] = vreinterpretq_f32_u32(vtstq_u32(bit, bit));
    }
    return (vmask){BITS(v_join(x))};
}

// A form that compilers know as one instruction, bsl.
static inline vfloat v_select(vmask m, vfloat yes, vfloat no) {
    return FLOATS(BITS(no) ^ ((BITS(yes) ^ BITS(no)) & m.bits));
}

static inline vfloat v_select_or_zero(vmask m, vfloat a) {
    return FLOATS(m.bits & BITS(a));
}

static inline vfloat v_zero_where(vmask m, vfloat a) {
    return FLOATS(~m.bits & BITS(a));
}

static inline vfloat v_negate_where(vmask m, vfloat a) {
    return FLOATS(BITS(a) ^ (m.bits & BITS(v_splat(-0.0f))));
}

static inline vfloat v_add_where(vmask m, vfloat a, vfloat b) {
    return a + v_select_or_zero(m, b);
}

static inline vfloat v_madd_where(vmask m, vfloat a, vfloat b, vfloat c) {
    return v_select(m, v_madd(a, b, c), a);
}

static inline vfloat v_abs(vfloat a) {
    return FLOATS(BITS(a) & 0x7fffffff);
}

static inline vfloat v_copysign(vfloat a, vfloat from) {
    return v_select((vmask){BITS(v_splat(-0.0f))}, from, a);
}

// In the order of the x86 words: of zeros of both signs the same is left.
#define REDUCTION(name, two)                                                                       \
    static inline float v_reduce_##name(vfloat a) {                                                \
        vregisters x = v_split(a);                                                                 \
        float32x4_t q = LANES == 8 ? two(x.of[0], x.of[LANES / 4 - 1]) : x.of[0];                  \
        q = two(q, vextq_f32(q, q, 2));                                                            \
        return vgetq_lane_f32(two(q, vextq_f32(q, q, 1)), 0);                                      \
    }
REDUCTION(min, min_register)
REDUCTION(max, max_register)
#undef REDUCTION

static inline vfloat v_max_of_lanes(vfloat a) {
    vregisters x = v_split(a), y;
    EACH_REGISTER(i) {
        float32x4_t q = LANES == 8 ? max_register(x.of[i], x.of[LANES / 4 - 1 - i]) : x.of[0];
        q = max_register(q, vextq_f32(q, q, 2));
        y.of[i] = max_register(q, vrev64q_f32(q));
    }
    return v_join(y);
}

static inline vindex v_whole(vfloat a) { // of whole numbers
    return __builtin_convertvector(a, vindex);
}

static inline vfloat v_of_whole(vindex a) {
    return __builtin_convertvector(a, vfloat);
}

static inline vfloat v_exponent(vfloat a) {
    return v_of_whole((vindex)((vbits)a >> 23) - 127);
}

static inline vfloat v_mantissa(vfloat a) {
    return FLOATS((BITS(a) & 0x007fffff) | 0x3f800000);
}

static inline vfloat v_mantissa_near_1(vfloat a, vfloat *exponent) {
    vindex steps = (vindex)((vbits)a - 0x3f400000) >> 23;
    *exponent = v_of_whole(steps);
    return FLOATS((vbits)a - ((vbits)steps << 23));
}

static inline vfloat v_ldexp(vfloat a, vfloat n) {
    return FLOATS((vbits)a + ((vbits)v_whole(n) << 23));
}

static inline vfloat v_pow2_unit(vfloat a) {
    return FLOATS(0x7f000000 - (BITS(a) & 0x7f800000));
}

#if LANES == 4
static inline void v_compress_store(vmask m, vfloat a, float to[LANES]) {
    for (unsigned rest = v_mask_bits(m); rest; rest &= rest - 1)
        *to++ = a[__builtin_ctz(rest)];
}
#else

typedef double vhalf __attribute__((vector_size(4 * LANES))); // doubles for half of the lanes
typedef struct {
    float64x2_t of[2];
} vhalf_registers;

typedef double vhalf_register __attribute__((vector_size(16), may_alias));

static inline vhalf_registers v_half_split(vhalf a) {
    vhalf_registers x;
    __builtin_memcpy(&x, &a, sizeof x);
    return x;
}

static inline vhalf v_half_join(float64x2_t low, float64x2_t high) {
    vhalf a;
    ((vhalf_register *)&a)[0] = low;
    ((vhalf_register *)&a)[1] = high;
    return a;
}

static inline vhalf v_half_splat(double a) {
    return (vhalf){a, a, a, a};
}

#define HALF_1(name, word)                                                                         \
    static inline vhalf v_half_##name(vhalf a) {                                                   \
        vhalf_registers x = v_half_split(a);                                                       \
        return v_half_join(word(x.of[0]), word(x.of[1]));                                          \
    }
#define HALF_3(name, word)                                                                         \
    static inline vhalf v_half_##name(vhalf a, vhalf b, vhalf c) {                                 \
        vhalf_registers x = v_half_split(a), y = v_half_split(b), z = v_half_split(c);             \
        return v_half_join(word(z.of[0], x.of[0], y.of[0]), word(z.of[1], x.of[1], y.of[1]));      \
    }
HALF_1(sqrt, vsqrtq_f64)
HALF_1(floor, vrndmq_f64)
HALF_3(madd, vfmaq_f64)
HALF_3(nmadd, vfmsq_f64)

static inline vhalf v_half_of_register(float32x4_t q) {
    return v_half_join(vcvt_f64_f32(vget_low_f32(q)), vcvt_high_f64_f32(q));
}

static inline float32x4_t v_register_of_half(vhalf a) {
    vhalf_registers x = v_half_split(a);
    return vcvt_high_f32_f64(vcvt_f32_f64(x.of[0]), x.of[1]);
}

static inline vhalf v_half_rsqrt_approx(vhalf a) {
    return v_half_of_register(rsqrt_register(v_register_of_half(a)));
}

static inline vhalf v_half_low(vfloat a) {
    return v_half_of_register(v_split(a).of[0]);
}

static inline vhalf v_half_high(vfloat a) {
    return v_half_of_register(v_split(a).of[1]);
}

static inline vfloat v_from_halves(vhalf low, vhalf high) {
    return v_join((vregisters){{v_register_of_half(low), v_register_of_half(high)}});
}

static inline void v_store_or_stream(float *to, bool stream, vfloat a) {
    (void)stream; // no plain store goes past the caches
    v_store(a, to);
}

#endif
