// A vector of BITS at a time, in float or double (DOUBLE): instructions, the bit trick, own
// polynomials, libmvec (glibc's; names after Intel's "Vector Function ABI", variants b, d and e)
// and SLEEF (N. Shibata and F. Petrogalli, "SLEEF: a portable vectorized library of C standard
// mathematical functions", IEEE TPDS 31(6), 2020).
#include "simd.h"

#if BITS == 128
#define ISA "SSE"
#define NEEDS "sse4.1" // libmvec's b variants use it
#define LIBMVEC_CODE "b"
#define SLEEF_CODE "sse4"
#define THIS_IS sse
#elif BITS == 256
#define ISA "AVX2"
#define NEEDS "avx2 fma"
#define LIBMVEC_CODE "d"
#define SLEEF_CODE "avx2"
#define THIS_IS avx2
#else
#define ISA "AVX-512"
#define NEEDS "avx512f avx512dq"
#define LIBMVEC_CODE "e"
#define SLEEF_CODE "avx512f"
#define THIS_IS avx512
#endif
#if BITS == 128 && DOUBLE
#define LANES "2"
#elif BITS == 128 || (BITS == 256 && DOUBLE)
#define LANES "4"
#elif BITS == 256 || DOUBLE
#define LANES "8"
#else
#define LANES "16"
#endif
#if DOUBLE
#define SUFFIX ""
#define SLEEF_TYPE "d"
#define THIS JOIN3(THIS_IS, _, double)
static const whole MAGIC = 0x5fe6eb50c7b537a9;
#else
#define SUFFIX "f"
#define SLEEF_TYPE "f"
#define THIS JOIN3(THIS_IS, _, float)
static const whole MAGIC = 0x5f375a86;
#endif

static inline V linked(V a, V last, V none) {
    return (V)((I)a | ((I)last & (I)none));
}

#include "kernels.h"

static inline V trick(V x) {
    return (V)(iset(MAGIC) - ((I)x >> 1)); // x > 0
}

#if BITS == 512
#define HAS_INSTRUCTION 1
static inline V instruction(V x) {
    return MM(rsqrt14)(x);
}
#elif !DOUBLE
#define HAS_INSTRUCTION 1
static inline V instruction(V x) {
    return MM(rsqrt)(x);
}
#else
#define HAS_INSTRUCTION 0
#endif
#if BITS == 512 && DOUBLE
#define RSQRT "rsqrt14pd"
#elif BITS == 512
#define RSQRT "rsqrt14ps"
#else
#define RSQRT "rsqrtps"
#endif

UNARY(link, x)
UNARY(sqrt_exact, MM(sqrt)(x))
UNARY(rsqrt_exact, 1 / MM(sqrt)(x))
UNARY(trick_0, trick(x))
UNARY(trick_1, newton(x, trick(x)))
UNARY(trick_2, newton(x, newton(x, trick(x))))
#if HAS_INSTRUCTION
UNARY(rsqrt_0, instruction(x))
UNARY(rsqrt_1, newton(x, instruction(x)))
UNARY(rsqrt_2, newton(x, newton(x, instruction(x))))
UNARY(root_0, x *instruction(x))
UNARY(root_1, x *newton(x, instruction(x)))
UNARY(root_2, x *newton(x, newton(x, instruction(x))))
#endif
UNARY(library_1, ((unary *)f)(x))
BINARY(library_2, ((binary *)f)(x, y))
#if BITS > 128
#include "own.h"
UNARY(own_exp, own_exp(x))
UNARY(own_log, own_log(x))
UNARY(own_sin, own_sin(x))
UNARY(own_cos, own_cos(x))
UNARY(own_acos, own_acos(x))
BINARY(own_pow, own_pow(x, y))
BINARY(own_atan2, own_atan2(x, y))
#endif

#define VECTOR(NAME, V_S, KERNEL)                                                                  \
    FOUND(NAME, "libmvec", "libmvec", "_ZGV" LIBMVEC_CODE "N" LANES V_S "_" NAME SUFFIX, KERNEL)
#define SLEEF(NAME, U, KERNEL)                                                                     \
    FOUND(NAME, "SLEEF", "SLEEF u" U, "Sleef_" NAME SLEEF_TYPE LANES "_u" U SLEEF_CODE, KERNEL)

static const struct entry TABLE[] = {
    ENTRY("link", "link", "link", link),
    ENTRY("sqrt", "instruction", "sqrt", sqrt_exact),
    ENTRY("rsqrt", "instruction", "1/sqrt", rsqrt_exact),
    ENTRY("rsqrt", "bit trick", "Lomont + 0", trick_0),
    ENTRY("rsqrt", "bit trick", "Lomont + 1", trick_1),
    ENTRY("rsqrt", "bit trick", "Lomont + 2", trick_2),
#if HAS_INSTRUCTION
    ENTRY("rsqrt", "instruction", RSQRT " + 0", rsqrt_0),
    ENTRY("rsqrt", "instruction", RSQRT " + 1", rsqrt_1),
    ENTRY("rsqrt", "instruction", RSQRT " + 2", rsqrt_2),
    ENTRY("sqrt", "instruction", "x·" RSQRT " + 0", root_0),
    ENTRY("sqrt", "instruction", "x·" RSQRT " + 1", root_1),
    ENTRY("sqrt", "instruction", "x·" RSQRT " + 2", root_2),
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
#if BITS > 128
    ENTRY("exp", "own", "own", own_exp),
    ENTRY("log", "own", "own", own_log),
    ENTRY("pow", "own", "own", own_pow),
    ENTRY("sin", "own", "own", own_sin),
    ENTRY("cos", "own", "own", own_cos),
    ENTRY("atan2", "own", "own", own_atan2),
    ENTRY("acos", "own", "own", own_acos),
#endif
};

#if !DOUBLE
static inline V squared_length(V x, V y, V z) {
    return x * x + y * y + z * z;
}
#define NORMALISE(NAME, FACTOR)                                                                    \
    static void NAME(size_t n, float *px, float *py, float *pz) {                                  \
        for (size_t i = 0; i < n; i += WIDE) {                                                     \
            V x = vload(px + i), y = vload(py + i), z = vload(pz + i), r = FACTOR;                 \
            vstore(px + i, x * r), vstore(py + i, y * r), vstore(pz + i, z * r);                   \
        }                                                                                          \
    }
NORMALISE(normalise_exact, 1 / MM(sqrt)(squared_length(x, y, z)))
NORMALISE(normalise_newton, newton(squared_length(x, y, z), instruction(squared_length(x, y, z))))
NORMALISE(touch, vset(-1)) // the same loads and stores, and next to no arithmetic
static const struct normaliser NORMALISERS[] = {{"1/sqrt", "SoA", normalise_exact},
                                                {RSQRT " + 1", "SoA", normalise_newton},
                                                {"no arithmetic", "SoA", touch}};
#endif

const struct entries THIS = {
    .isa = ISA,
    .needs = NEEDS,
    .bits = BITS,
    .is_double = DOUBLE,
    .count = sizeof TABLE / sizeof *TABLE,
    .entry = TABLE,
#if !DOUBLE
    .normaliser = NORMALISERS,
    .normalisers = sizeof NORMALISERS / sizeof *NORMALISERS,
#endif
};
