// Streams and chains around an expression of the vector x (and y). simd.h comes first; V may be one
// lane wide there: scalar.h has its own.
#ifndef STEPWISE_FUNCTIONS_KERNELS_H
#define STEPWISE_FUNCTIONS_KERNELS_H

#include "bench.h"

typedef V unary(V);
typedef V binary(V, V);

#define UNARY(NAME, EXPRESSION)                                                                    \
    static void NAME##_stream(any_function f, size_t n, const void *a, const void *b, void *out) { \
        (void)f, (void)b;                                                                          \
        const elem *from = a;                                                                      \
        elem *to = out;                                                                            \
        for (size_t i = 0; i < n; i += WIDE) {                                                     \
            V x = vload(from + i);                                                                 \
            vstore(to + i, EXPRESSION);                                                            \
        }                                                                                          \
    }                                                                                              \
    static void NAME##_chain(any_function f, size_t n, const void *a, const void *b,               \
                             const void *zero, void *out) {                                        \
        (void)f, (void)b;                                                                          \
        const elem *from = a;                                                                      \
        V last = vset(0), none = vload(zero);                                                      \
        for (size_t i = 0; i < n; i++) {                                                           \
            V x = linked(vload(from + i * WIDE), last, none);                                      \
            last = EXPRESSION;                                                                     \
        }                                                                                          \
        vstore(out, last);                                                                         \
    }

#define BINARY(NAME, EXPRESSION)                                                                   \
    static void NAME##_stream(any_function f, size_t n, const void *a, const void *b, void *out) { \
        (void)f;                                                                                   \
        const elem *from = a, *and_from = b;                                                       \
        elem *to = out;                                                                            \
        for (size_t i = 0; i < n; i += WIDE) {                                                     \
            V x = vload(from + i), y = vload(and_from + i);                                        \
            vstore(to + i, EXPRESSION);                                                            \
        }                                                                                          \
    }                                                                                              \
    static void NAME##_chain(any_function f, size_t n, const void *a, const void *b,               \
                             const void *zero, void *out) {                                        \
        (void)f;                                                                                   \
        const elem *from = a, *and_from = b;                                                       \
        V last = vset(0), none = vload(zero);                                                      \
        for (size_t i = 0; i < n; i++) {                                                           \
            V x = linked(vload(from + i * WIDE), last, none);                                      \
            V y = linked(vload(and_from + i * WIDE), last, none);                                  \
            last = EXPRESSION;                                                                     \
        }                                                                                          \
        vstore(out, last);                                                                         \
    }

#define ENTRY(FUNCTION, FAMILY, NAME, KERNEL)                                                      \
    {FUNCTION, FAMILY, NAME, NULL, KERNEL##_stream, KERNEL##_chain}
// From a shared library, by name, at run time.
#define FOUND(FUNCTION, FAMILY, NAME, SYMBOL, KERNEL)                                              \
    {FUNCTION, FAMILY, NAME, SYMBOL, KERNEL##_stream, KERNEL##_chain}

// y(1.5 − x/2·y²): a step of Newton's method for 1/√x.
static inline V newton(V x, V y) {
    return y * ((elem)1.5 - (elem)0.5 * x * y * y);
}

#endif
