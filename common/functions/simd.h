// One vector type for kernels of any width: BITS (128, 256, 512) and DOUBLE (0, 1) are set by the
// file that includes this. gcc's and clang's operators do + − × ÷ and comparisons; what they lack
// is named by MM(op), the intrinsic of that width and precision.
#ifndef STEPWISE_FUNCTIONS_SIMD_H
#define STEPWISE_FUNCTIONS_SIMD_H

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
typedef int64_t whole;
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
typedef int32_t whole;
enum { MANTISSA = 23 };
#if BITS == 128
typedef __m128 V;
#elif BITS == 256
typedef __m256 V;
#else
typedef __m512 V;
#endif
#endif

// Masks and bits of V: all bits of a lane set, or none.
typedef whole I __attribute__((vector_size(BITS / 8)));
enum { WIDE = BITS / 8 / sizeof(elem) };

static inline V vset(elem a) {
    return MM(set1)(a);
}

static inline I iset(whole a) {
    I all;
    for (size_t i = 0; i < WIDE; i++)
        all[i] = a;
    return all;
}

static inline V vload(const elem *from) {
    return MM(loadu)(from);
}

static inline void vstore(elem *to, V a) {
    MM(storeu)(to, a);
}

static inline V pick(I where, V yes, V no) {
    return (V)((where & (I)yes) | (~where & (I)no));
}

static inline I sign_bits(V a) {
    return (I)a & (I)vset((elem)-0.0);
}

static inline V magnitude(V a) {
    return (V)((I)a ^ sign_bits(a));
}

#if BITS > 128 // the wider ones come with FMA
static inline V fma_(V a, V b, V c) {
    return MM(fmadd)(a, b, c);
}

static inline V fnma(V a, V b, V c) {
    return MM(fnmadd)(a, b, c);
}
#endif

#endif
