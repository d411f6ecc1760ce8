// Arithmetic kernels: fma, add, mul, minmax, div, sqrt, rsqrt and mixes of add and mul, in double and
// single precision, from scalar to 512 bits (x86-64: arithmetic.c) or 128 bits (arm64: neon.c).
//
// A kernel loads all registers from `in`, executes its body `loops` times and stores the registers
// to `out`. The body is long, because counting the loop may take the slot of an operation. Each of
// the three forms keeps the operands normal and lets the result show how often the body ran:
//   CHAINED      x = x op c in 14 registers, four times. 14 chains cover a latency of 4 cycles at 3
//                operations per cycle. c is in register 14, the addend of fma in register 15.
//   FROM_RISING  t = op(x) in 10 registers, from 4 registers x that rise (x = x + c), four times. For
//                square roots, whose chains would converge.
//   RUNNING_MAX  x = max(x, y) in 12 registers, 16 times, then y = y + c. A maximum with a constant
//                would converge.
// On arm64 all this is done in registers 0 to 15 and again in 16 to 31, with the constants of 14 and 15.
// Scalar and 128-bit kernels of x86-64 use the legacy encoding, as a build without AVX does. Instructions
// that exist only in VEX or EVEX encoding are the exception.
#pragma once

#include <stdbool.h>

#include "registers.h"

enum { BODY_REPEATS = 4 }; // repetitions of the operations in the body of CHAINED and FROM_RISING
enum form { CHAINED, FROM_RISING, RUNNING_MAX };
enum kind { FMA, ADD, MUL, MINMAX, DIV, SQRT, RSQRT, ADD_MUL, ADD_2MUL, TWO_ADD_MUL, KINDS };
extern const char *const KIND_NAMES[KINDS];

struct arithmetic_kernel {
    enum kind kind;
    bool is_double;
    int bits; // width of the operands; of the element in scalar code
    void (*run)(long loops, const void *in, void *out);
    const char *needs; // CPU feature beyond x86-64 or arm64, or NULL
    double tolerance;  // largest relative error; 0: exact bit for bit
};
#ifdef __aarch64__
enum { ARITHMETIC_KERNEL_COUNT = 40 };
#else
enum { ARITHMETIC_KERNEL_COUNT = 80 };
#endif
extern const struct arithmetic_kernel ARITHMETIC_KERNELS[ARITHMETIC_KERNEL_COUNT];

enum form kernel_form(enum kind kind);
int operations_per_loop(enum kind kind);
int kernel_lanes(const struct arithmetic_kernel *c);
// FLOPs of one instruction; a fused multiply-add is two per lane.
int flops_per_operation(const struct arithmetic_kernel *c);
// Writes a name for messages, such as "fma double 256 bits".
void kernel_name(const struct arithmetic_kernel *c, char text[64]);
