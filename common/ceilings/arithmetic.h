// Kernels of arithmetic: fma, add, mul, minmax, div, sqrt and rsqrt, scalar to 512 bits, double and
// single, and adds and multiplications mixed.
//
// All 16 registers come from `in` and go to `out`, one per slot of 64 bytes; between them `loops`
// times the body, which is long: counting the loop may take an operation's place. Three forms, each
// so that results tell how often the body ran, and with operands that stay normal:
//   CHAINS  x = x op c in 14 registers, four times: 14 chains cover latency 4 at 3 a cycle. c is in
//           14, the addend of fma in 15.
//   APART   t = op(x) of 10 registers from 4 rising ones (x = x + c, 10 to 13), four times: square
//           roots would converge.
//   RISING  x = max(x, y) of 12 registers 16 times, then y = y + c (12): the maximum of a constant
//           converges.
// Scalar and 128 bits are in the legacy encoding (what a build without AVX executes), but for what
// only VEX or EVEX has.
#ifndef STEPWISE_CEILINGS_ARITHMETIC_H
#define STEPWISE_CEILINGS_ARITHMETIC_H

#include <stdbool.h>

#include "registers.h"

enum { TIMES = 4 }; // the body of CHAINS and APART has its operations so often
enum form { CHAINS, APART, RISING };
enum kind { FMA, ADD, MUL, MINMAX, DIV, SQRT, RSQRT, ADD_MUL, ADD_2MUL, TWO_ADD_MUL, KINDS };
extern const char *const KIND_NAMES[KINDS];

struct compute {
    enum kind kind;
    bool is_double;
    int bits; // of what one instruction works on: the element's where scalar
    void (*run)(long loops, const void *in, void *out);
    const char *needs; // of the CPU beyond x86-64, or NULL
    double tolerance;  // relative; 0: bit for bit
};
enum { COMPUTES = 80 };
extern const struct compute COMPUTE[COMPUTES];

enum form form_of(enum kind kind);
int per_loop(enum kind kind); // operations of the body
int lanes_of(const struct compute *c);
int flops_of(const struct compute *c); // of one operation; a fused one is two
void name_of(const struct compute *c, char text[64]);

#endif
