// Macros that make a stream and a chain of an expression of x (and y); see bench.h. The including
// file first defines V, vload, vstore and the rest: vector_kernels.c by simd.h, scalar_kernels.c
// with one lane.
#pragma once

#include "bench.h"

typedef V unary(V);
typedef V binary(V, V);

// LOAD_Y and CHAIN_Y: how y is read in a stream and in a chain; empty for functions of x alone.
#define KERNEL(NAME, LOAD_Y, CHAIN_Y, EXPRESSION)                                                  \
    static void NAME##_stream(library_function f, size_t n, const void *a, const void *b,          \
                              void *out) {                                                         \
        (void)f, (void)b;                                                                          \
        const elem *from = a;                                                                      \
        elem *to = out;                                                                            \
        for (size_t i = 0; i < n; i += VECTOR_LANES) {                                             \
            V x = vload(from + i);                                                                 \
            LOAD_Y vstore(to + i, EXPRESSION);                                                     \
        }                                                                                          \
    }                                                                                              \
    static void NAME##_chain(library_function f, size_t n, const void *a, const void *b,           \
                             const void *zero, void *out) {                                        \
        (void)f, (void)b;                                                                          \
        const elem *from = a;                                                                      \
        V last = vsplat(0), none = vload(zero);                                                    \
        for (size_t i = 0; i < n; i++) {                                                           \
            V x = depend(vload(from + i * VECTOR_LANES), last, none);                              \
            CHAIN_Y last = EXPRESSION;                                                             \
        }                                                                                          \
        vstore(out, last);                                                                         \
    }
#define UNARY(NAME, EXPRESSION) KERNEL(NAME, , , EXPRESSION)
#define BINARY(NAME, EXPRESSION)                                                                   \
    KERNEL(NAME, V y = vload((const elem *)b + i);                                                 \
           , V y = depend(vload((const elem *)b + i * VECTOR_LANES), last, none);, EXPRESSION)

#define ENTRY(FUNCTION, FAMILY, NAME, KERNEL)                                                      \
    {FUNCTION, FAMILY, NAME, NULL, KERNEL##_stream, KERNEL##_chain}
// An entry whose function is in a shared library, found by name at run time.
#define LIBRARY_ENTRY(FUNCTION, FAMILY, NAME, SYMBOL, KERNEL)                                      \
    {FUNCTION, FAMILY, NAME, SYMBOL, KERNEL##_stream, KERNEL##_chain}

// One step of Newton's method for 1/√x: y(1.5 − x/2·y²).
static inline V newton(V x, V y) {
    return y * ((elem)1.5 - (elem)0.5 * x * y * y);
}
