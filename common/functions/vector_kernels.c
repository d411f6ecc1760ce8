// Kernels that compute a vector at a time: instructions, the bit trick, our polynomials, glibc's
// libmvec (names after Intel's "Vector Function ABI", variants b, d and e) and SLEEF (N. Shibata and
// F. Petrogalli, "SLEEF: a portable vectorized library of C standard mathematical functions", IEEE
// TPDS 31(6), 2020). Compiled once for each BITS and DOUBLE (functions.mk).
#include "simd.h"

#ifdef __aarch64__
#define ISA "NEON"
#define LIBMVEC_CODE "n"
#define SLEEF_CODE "advsimd"
#define ISA_NAME sse
#elif BITS == 128
#define ISA "SSE"
#define LIBMVEC_CODE "b"
#define SLEEF_CODE "sse4"
#define ISA_NAME sse
#elif BITS == 256
#define ISA "AVX2"
#define LIBMVEC_CODE "d"
#define SLEEF_CODE "avx2"
#define ISA_NAME avx2
#else
#define ISA "AVX-512"
#define LIBMVEC_CODE "e"
#define SLEEF_CODE "avx512f"
#define ISA_NAME avx512
#endif
#if BITS == 128 && DOUBLE
#define LANE_COUNT_TEXT "2"
#elif BITS == 128 || (BITS == 256 && DOUBLE)
#define LANE_COUNT_TEXT "4"
#elif BITS == 256 || DOUBLE
#define LANE_COUNT_TEXT "8"
#else
#define LANE_COUNT_TEXT "16"
#endif
#if DOUBLE
#define SUFFIX ""
#define SLEEF_TYPE "d"
#define TABLE_NAME JOIN3(ISA_NAME, _, double)
static const ielem LOMONT_MAGIC = 0x5fe6eb50c7b537a9;
#else
#define SUFFIX "f"
#define SLEEF_TYPE "f"
#define TABLE_NAME JOIN3(ISA_NAME, _, float)
static const ielem LOMONT_MAGIC = 0x5f375a86;
#endif

static inline V depend(V a, V last, V none) {
    return (V)((I)a | ((I)last & (I)none));
}

#include "kernels.h"

static inline V bit_trick(V x) {
    return (V)(isplat(LOMONT_MAGIC) - ((I)x >> 1)); // x > 0
}

#if BITS == 512
#define HAS_ESTIMATE 1
static inline V rsqrt_estimate(V x) {
    return MM(rsqrt14)(x);
}
#elif !DOUBLE
#define HAS_ESTIMATE 1
static inline V rsqrt_estimate(V x) {
#ifdef __aarch64__
    return vrsqrteq_f32(x); // SIMDe's has Newton's steps
#else
    return MM(rsqrt)(x);
#endif
}
#else
#define HAS_ESTIMATE 0
#endif
#if BITS == 512 && DOUBLE
#define RSQRT "rsqrt14pd"
#elif BITS == 512
#define RSQRT "rsqrt14ps"
#elif defined __aarch64__
#define RSQRT "frsqrte"
#else
#define RSQRT "rsqrtps"
#endif

UNARY(link, x)
UNARY(sqrt_exact, MM(sqrt)(x))
UNARY(rsqrt_exact, 1 / MM(sqrt)(x))
UNARY(trick_0, bit_trick(x))
UNARY(trick_1, newton(x, bit_trick(x)))
UNARY(trick_2, newton(x, newton(x, bit_trick(x))))
#if HAS_ESTIMATE
UNARY(rsqrt_0, rsqrt_estimate(x))
UNARY(rsqrt_1, newton(x, rsqrt_estimate(x)))
UNARY(rsqrt_2, newton(x, newton(x, rsqrt_estimate(x))))
UNARY(sqrt_estimate_0, x *rsqrt_estimate(x))
UNARY(sqrt_estimate_1, x *newton(x, rsqrt_estimate(x)))
UNARY(sqrt_estimate_2, x *newton(x, newton(x, rsqrt_estimate(x))))
#endif
UNARY(library_1, ((unary *)f)(x))
BINARY(library_2, ((binary *)f)(x, y))
#if HAS_FMA
#include "polynomials.h"
UNARY(poly_exp, poly_exp(x))
UNARY(poly_log, poly_log(x))
UNARY(poly_sin, poly_sin(x))
UNARY(poly_cos, poly_cos(x))
UNARY(poly_acos, poly_acos(x))
BINARY(poly_pow, poly_pow(x, y))
BINARY(poly_atan2, poly_atan2(x, y))
#endif

#define VECTOR(NAME, V_S, KERNEL)                                                                  \
    LIBRARY_ENTRY(NAME, "libmvec", "libmvec",                                                      \
                  "_ZGV" LIBMVEC_CODE "N" LANE_COUNT_TEXT V_S "_" NAME SUFFIX, KERNEL)
#define SLEEF(NAME, U, KERNEL)                                                                     \
    LIBRARY_ENTRY(NAME, "SLEEF", "SLEEF u" U,                                                      \
                  "Sleef_" NAME SLEEF_TYPE LANE_COUNT_TEXT "_u" U SLEEF_CODE, KERNEL)

static const struct entry TABLE[] = {
    ENTRY("link", "link", "link", link),
    ENTRY("sqrt", "instruction", "sqrt", sqrt_exact),
    ENTRY("rsqrt", "instruction", "1/sqrt", rsqrt_exact),
    ENTRY("rsqrt", "bit trick", "Lomont + 0", trick_0),
    ENTRY("rsqrt", "bit trick", "Lomont + 1", trick_1),
    ENTRY("rsqrt", "bit trick", "Lomont + 2", trick_2),
#if HAS_ESTIMATE
    ENTRY("rsqrt", "instruction", RSQRT " + 0", rsqrt_0),
    ENTRY("rsqrt", "instruction", RSQRT " + 1", rsqrt_1),
    ENTRY("rsqrt", "instruction", RSQRT " + 2", rsqrt_2),
    ENTRY("sqrt", "instruction", "x·" RSQRT " + 0", sqrt_estimate_0),
    ENTRY("sqrt", "instruction", "x·" RSQRT " + 1", sqrt_estimate_1),
    ENTRY("sqrt", "instruction", "x·" RSQRT " + 2", sqrt_estimate_2),
#endif
    VECTOR("exp", "v", library_1),
    VECTOR("log", "v", library_1),
    VECTOR("pow", "vv", library_2),
    VECTOR("sin", "v", library_1),
    VECTOR("cos", "v", library_1),
    VECTOR("atan2", "vv", library_2),
    VECTOR("acos", "v", library_1),
    SLEEF("sqrt", "35", library_1),
    SLEEF("exp", "10", library_1),
    SLEEF("log", "10", library_1),
    SLEEF("log", "35", library_1),
    SLEEF("pow", "10", library_2),
    SLEEF("sin", "10", library_1),
    SLEEF("sin", "35", library_1),
    SLEEF("cos", "10", library_1),
    SLEEF("cos", "35", library_1),
    SLEEF("atan2", "10", library_2),
    SLEEF("atan2", "35", library_2),
    SLEEF("acos", "10", library_1),
    SLEEF("acos", "35", library_1),
#if HAS_FMA
    ENTRY("exp", "own", "own", poly_exp),
    ENTRY("log", "own", "own", poly_log),
    ENTRY("pow", "own", "own", poly_pow),
    ENTRY("sin", "own", "own", poly_sin),
    ENTRY("cos", "own", "own", poly_cos),
    ENTRY("atan2", "own", "own", poly_atan2),
    ENTRY("acos", "own", "own", poly_acos),
#endif
};

#if !DOUBLE
static inline V squared_length(V x, V y, V z) {
    return x * x + y * y + z * z;
}
#define NORMALISE(NAME, FACTOR)                                                                    \
    static void NAME(size_t n, float *px, float *py, float *pz) {                                  \
        for (size_t i = 0; i < n; i += VECTOR_LANES) {                                             \
            V x = vload(px + i), y = vload(py + i), z = vload(pz + i), r = FACTOR;                 \
            vstore(px + i, x * r), vstore(py + i, y * r), vstore(pz + i, z * r);                   \
        }                                                                                          \
    }
NORMALISE(normalise_exact, 1 / MM(sqrt)(squared_length(x, y, z)))
NORMALISE(normalise_newton,
          newton(squared_length(x, y, z), rsqrt_estimate(squared_length(x, y, z))))
NORMALISE(load_and_store, vsplat(-1)) // the same loads and stores, almost no arithmetic
static const struct normaliser NORMALISERS[] = {{"1/sqrt", "SoA", normalise_exact},
                                                {RSQRT " + 1", "SoA", normalise_newton},
                                                {"no arithmetic", "SoA", load_and_store}};
#endif

const struct entries TABLE_NAME = {
    .isa = ISA,
    .bits = BITS,
    .is_double = DOUBLE,
    .count = sizeof TABLE / sizeof *TABLE,
    .entry = TABLE,
#if !DOUBLE
    .normaliser = NORMALISERS,
    .normalisers = sizeof NORMALISERS / sizeof *NORMALISERS,
#endif
};
