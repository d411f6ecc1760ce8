// Kernels that compute one element at a time: libm, the bit trick, rsqrtss. Compiled twice, with
// DOUBLE defined as 0 and as 1 (functions.mk).
//
// The bit trick: constant of C. Lomont, "Fast inverse square root" (2003), for double of M.
// Robertson, "A brief history of InvSqrt" (2012); with corrected Newton steps of L. Moroz, C.
// Walczyk, A. Hrynchyshyn, V. Holimath and J. Cieśliński, "Fast calculation of inverse square root
// with the use of magic constant – analytical approach", Appl. Math. Comput. 316 (2018), and their
// 2019 and 2021 papers.
#include <immintrin.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if DOUBLE
typedef double elem;
typedef uint64_t uelem;
#define LIBM(NAME) NAME
#define TABLE_NAME scalar_double
static const uelem LOMONT_MAGIC = 0x5fe6eb50c7b537a9;
#else
typedef float elem;
typedef uint32_t uelem;
#define LIBM(NAME) NAME##f
#define TABLE_NAME scalar_float
static const uelem LOMONT_MAGIC = 0x5f375a86, MOROZ_MAGIC = 0x5f376908;
#endif
typedef elem V;
enum { VECTOR_LANES = 1 };

static inline V vsplat(elem a) {
    return a;
}
static inline V vload(const void *from) {
    V a;
    memcpy(&a, from, sizeof a);
    return a;
}
static inline void vstore(void *to, V a) {
    memcpy(to, &a, sizeof a);
}
static inline uelem as_bits(V a) {
    uelem bits;
    memcpy(&bits, &a, sizeof bits);
    return bits;
}
static inline V from_bits(uelem bits) {
    V a;
    memcpy(&a, &bits, sizeof a);
    return a;
}
static inline V depend(V a, V last, V none) {
    return from_bits(as_bits(a) | (as_bits(last) & as_bits(none)));
}

#include "kernels.h"

static inline V bit_trick(V x, uelem magic) {
    return from_bits(magic - (as_bits(x) >> 1));
}

UNARY(link, x)
UNARY(libm_sqrt, LIBM(sqrt)(x))
UNARY(libm_rsqrt, 1 / LIBM(sqrt)(x))
UNARY(trick_0, bit_trick(x, LOMONT_MAGIC))
UNARY(trick_1, newton(x, bit_trick(x, LOMONT_MAGIC)))
UNARY(trick_2, newton(x, newton(x, bit_trick(x, LOMONT_MAGIC))))
UNARY(libm_exp, LIBM(exp)(x))
UNARY(libm_log, LIBM(log)(x))
UNARY(libm_sin, LIBM(sin)(x))
UNARY(libm_cos, LIBM(cos)(x))
UNARY(libm_acos, LIBM(acos)(x))
BINARY(libm_pow, LIBM(pow)(x, y))
BINARY(libm_atan2, LIBM(atan2)(x, y))
#if !DOUBLE
static inline V moroz_1(V x) {
    V y = bit_trick(x, MOROZ_MAGIC);
    return y * (1.50087896f - 0.5f * x * y * y);
}
static inline V moroz_2(V x) {
    V y = moroz_1(x);
    return y * (1.50000057f - 0.5f * x * y * y);
}
#ifdef __aarch64__
#define RSQRT "frsqrte"
static inline V rsqrt_estimate(V x) {
    return vrsqrtes_f32(x);
}
#else
#define RSQRT "rsqrtss"
static inline V rsqrt_estimate(V x) {
    return _mm_cvtss_f32(_mm_rsqrt_ss(_mm_set_ss(x)));
}
#endif
UNARY(moroz_0, bit_trick(x, MOROZ_MAGIC))
UNARY(moroz_1, moroz_1(x))
UNARY(moroz_2, moroz_2(x))
UNARY(rsqrtss_0, rsqrt_estimate(x))
UNARY(rsqrtss_1, newton(x, rsqrt_estimate(x)))
UNARY(rsqrtss_2, newton(x, newton(x, rsqrt_estimate(x))))
UNARY(sqrt_estimate_0, x *rsqrt_estimate(x))
UNARY(sqrt_estimate_1, x *newton(x, rsqrt_estimate(x)))
UNARY(sqrt_estimate_2, x *newton(x, newton(x, rsqrt_estimate(x))))
#endif

static const struct entry TABLE[] = {
    ENTRY("link", "link", "link", link),
    ENTRY("sqrt", "libm", "libm", libm_sqrt),
    ENTRY("rsqrt", "libm", "1/sqrt", libm_rsqrt),
    ENTRY("rsqrt", "bit trick", "Lomont + 0", trick_0),
    ENTRY("rsqrt", "bit trick", "Lomont + 1", trick_1),
    ENTRY("rsqrt", "bit trick", "Lomont + 2", trick_2),
    ENTRY("exp", "libm", "libm", libm_exp),
    ENTRY("log", "libm", "libm", libm_log),
    ENTRY("pow", "libm", "libm", libm_pow),
    ENTRY("sin", "libm", "libm", libm_sin),
    ENTRY("cos", "libm", "libm", libm_cos),
    ENTRY("atan2", "libm", "libm", libm_atan2),
    ENTRY("acos", "libm", "libm", libm_acos),
#if !DOUBLE
    ENTRY("rsqrt", "bit trick", "Moroz + 0", moroz_0),
    ENTRY("rsqrt", "bit trick", "Moroz + 1", moroz_1),
    ENTRY("rsqrt", "bit trick", "Moroz + 2", moroz_2),
    ENTRY("rsqrt", "instruction", RSQRT " + 0", rsqrtss_0),
    ENTRY("rsqrt", "instruction", RSQRT " + 1", rsqrtss_1),
    ENTRY("rsqrt", "instruction", RSQRT " + 2", rsqrtss_2),
    ENTRY("sqrt", "instruction", "x·" RSQRT " + 0", sqrt_estimate_0),
    ENTRY("sqrt", "instruction", "x·" RSQRT " + 1", sqrt_estimate_1),
    ENTRY("sqrt", "instruction", "x·" RSQRT " + 2", sqrt_estimate_2),
#endif
};

#if !DOUBLE
// The scalar loop of Bikker's article (normalise.c).
static void aos(size_t n, float *v, float *y, float *z) {
    (void)y, (void)z;
    for (size_t i = 0; i < 3 * n; i += 3) {
        float r = 1.0f / sqrtf(v[i] * v[i] + v[i + 1] * v[i + 1] + v[i + 2] * v[i + 2]);
        v[i] *= r, v[i + 1] *= r, v[i + 2] *= r;
    }
}
static void soa(size_t n, float *x, float *y, float *z) {
    for (size_t i = 0; i < n; i++) {
        float r = 1.0f / sqrtf(x[i] * x[i] + y[i] * y[i] + z[i] * z[i]);
        x[i] *= r, y[i] *= r, z[i] *= r;
    }
}
static const struct normaliser NORMALISERS[] = {{"1/sqrt", "AoS", aos}, {"1/sqrt", "SoA", soa}};
#endif

const struct entries TABLE_NAME = {
    .isa = "scalar",
    .bits = 8 * sizeof(elem),
    .is_double = DOUBLE,
    .count = sizeof TABLE / sizeof *TABLE,
    .entry = TABLE,
#if !DOUBLE
    .normaliser = NORMALISERS,
    .normalisers = sizeof NORMALISERS / sizeof *NORMALISERS,
#endif
};
