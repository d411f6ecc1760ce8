// One vector type V for kernels of any width. The including file or the command line defines BITS
// (128, 256 or 512) and DOUBLE (0 or 1). gcc and clang provide + − × ÷ and comparisons of vectors.
// MM(op) names the intrinsic of that width and precision for other operations.
#pragma once

#include <immintrin.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define JOIN3_(A, B, C) A##B##C
#define JOIN3(A, B, C) JOIN3_(A, B, C)
#if BITS == 128
#define MM_PREFIX _mm_
#elif BITS == 256
#define MM_PREFIX _mm256_
#else
#define MM_PREFIX _mm512_
#endif

#if DOUBLE
#define MM(OP) JOIN3(MM_PREFIX, OP, _pd)
typedef double elem;
typedef int64_t ielem;
enum { MANTISSA = 52 };
#if BITS == 128
typedef __m128d V;
#elif BITS == 256
typedef __m256d V;
#else
typedef __m512d V;
#endif
#else
#define MM(OP) JOIN3(MM_PREFIX, OP, _ps)
typedef float elem;
typedef int32_t ielem;
enum { MANTISSA = 23 };
#if BITS == 128
typedef __m128 V;
#elif BITS == 256
typedef __m256 V;
#else
typedef __m512 V;
#endif
#endif

// Integers of the lanes' size: the bits of V, and masks (all bits of a lane set, or none).
typedef ielem I __attribute__((vector_size(BITS / 8)));
enum { VECTOR_LANES = BITS / 8 / sizeof(elem) };

static inline V vsplat(elem a) {
    return MM(set1)(a);
}

static inline I isplat(ielem a) {
    I all;
    for (size_t i = 0; i < VECTOR_LANES; i++)
        all[i] = a;
    return all;
}

static inline V vload(const elem *from) {
    return MM(loadu)(from);
}

static inline void vstore(elem *to, V a) {
    MM(storeu)(to, a);
}

// yes where the mask is set, no elsewhere.
static inline V vselect(I where, V yes, V no) {
    return (V)((where & (I)yes) | (~where & (I)no));
}

static inline I sign_bits(V a) {
    return (I)a & (I)vsplat((elem)-0.0);
}

static inline V vabs(V a) {
    return (V)((I)a ^ sign_bits(a));
}

// Kernels of 256 and 512 bits require FMA, and NEON has it.
#if BITS > 128 || defined __aarch64__
#define HAS_FMA 1
static inline V vfma(V a, V b, V c) {
    return MM(fmadd)(a, b, c);
}

static inline V vfnma(V a, V b, V c) {
    return MM(fnmadd)(a, b, c);
}
#else
#define HAS_FMA 0
#endif
