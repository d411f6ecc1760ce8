// Ceilings of this machine: what one core can do at best per cycle and per second.
//
//   ceilings [--json] [--check] [--samples N]
//
// Arithmetic: throughput of fma, add, mul, minmax, div, sqrt and rsqrt, scalar to 512 bits, double
// and single, and of adds and multiplications mixed (add+mul: in turn; add+2mul: 5 to 9; 2add+mul:
// 9 to 5): some cores have units for each and some for both, so that a mix issues more per cycle
// than either, and which mix does most depends on the core. Bandwidth: load, store and copy, out of
// L1, L2, L3 and memory.
//
// The estimate is the best that was seen three times (within 1 %). A ceiling is what the core could
// do undisturbed, and whatever disturbs (an interrupt, a neighbour on the other hyper-thread, a
// stolen time slice) makes a sample slower, so the best of many short ones, spread over the
// program's run time, comes nearest. But it may as well disturb the measuring of the clock, and
// then a figure per cycle comes out too high: such ones scatter, a ceiling repeats itself. Beside
// it stand the median, its 95 % interval and the worst: what was usual.
//
// Kernels are assembly, so that no compiler folds, hoists or drops them, and each says what it must
// have done: after its samples the registers are held against the same arithmetic done one by one
// in C, and what loads, stores and copies move is looked at byte by byte before they are timed.
//
// Methods: A. Fog, "Instruction tables" (agner.org/optimize), on chains and units; A. Abel, J.
// Reineke, "uops.info", ASPLOS 2019, on measuring throughput; J. D. McCalpin's STREAM for
// bandwidth, with bytes counted here as the core sees them (no write-allocate), as the cache-aware
// roofline wants them: A. Ilic, F. Pratas, L. Sousa, IEEE Computer Architecture Letters 13(1),
// 2014. Errors of rsqrt: Intel SDM vol. 2.
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "timer.h"

enum { OK, WRONG_WORK, BAD_INPUT, OUT_OF_MEMORY = 5 };
enum { REGISTERS = 16, SLOT = 64 }; // bytes of the widest register

// --- kernels of arithmetic ---
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
enum { TIMES = 4 }; // the body of CHAINS and APART has its operations so often
enum form { CHAINS, APART, RISING };
enum kind { FMA, ADD, MUL, MINMAX, DIV, SQRT, RSQRT, ADD_MUL, ADD_2MUL, TWO_ADD_MUL, KINDS };
static const char *const KIND_NAMES[KINDS] = {"fma",  "add",   "mul",     "minmax",   "div",
                                              "sqrt", "rsqrt", "add+mul", "add+2mul", "2add+mul"};

// clang-format off
#define RUN12(M, OP)                                                                               \
    M(OP, 0) M(OP, 1) M(OP, 2) M(OP, 3) M(OP, 4) M(OP, 5)                                          \
    M(OP, 6) M(OP, 7) M(OP, 8) M(OP, 9) M(OP, 10) M(OP, 11)
#define RUN14(M, OP) RUN12(M, OP) M(OP, 12) M(OP, 13)
#define RUN16(M, OP) RUN14(M, OP) M(OP, 14) M(OP, 15)
// clang-format on

// x = x op (14)
#define TWO(OP, I) OP " %%xmm14, %%xmm" #I "\n\t"
#define THREE_128(OP, I) OP " %%xmm14, %%xmm" #I ", %%xmm" #I "\n\t"
#define THREE_256(OP, I) OP " %%ymm14, %%ymm" #I ", %%ymm" #I "\n\t"
#define THREE_512(OP, I) OP " %%zmm14, %%zmm" #I ", %%zmm" #I "\n\t"
// x = x * (14) + (15)
#define FMA_128(OP, I) OP " %%xmm15, %%xmm14, %%xmm" #I "\n\t"
#define FMA_256(OP, I) OP " %%ymm15, %%ymm14, %%ymm" #I "\n\t"
#define FMA_512(OP, I) OP " %%zmm15, %%zmm14, %%zmm" #I "\n\t"
// x = max(x, (12))
#define MAX_TWO(OP, I) OP " %%xmm12, %%xmm" #I "\n\t"
#define MAX_256(OP, I) OP " %%ymm12, %%ymm" #I ", %%ymm" #I "\n\t"
#define MAX_512(OP, I) OP " %%zmm12, %%zmm" #I ", %%zmm" #I "\n\t"
// t = op(x); SCALAR: a three-operand one, whose upper part is the source's
#define UNARY(OP, R, T, X) OP " %%" R #X ", %%" R #T "\n\t"
#define SCALAR(OP, R, T, X) OP " %%" R #X ", %%" R #X ", %%" R #T "\n\t"
// clang-format off
#define TEN(M, OP, R)                                                                              \
    M(OP, R, 0, 10) M(OP, R, 1, 11) M(OP, R, 2, 12) M(OP, R, 3, 13) M(OP, R, 4, 10)                \
    M(OP, R, 5, 11) M(OP, R, 6, 12) M(OP, R, 7, 13) M(OP, R, 8, 10) M(OP, R, 9, 11)
#define RISE4(M, OP) M(OP, 10) M(OP, 11) M(OP, 12) M(OP, 13)
// A in registers 0, 2, 4 …, B in the others
#define IN_TURN(M, A, B)                                                                           \
    M(A, 0) M(B, 1) M(A, 2) M(B, 3) M(A, 4) M(B, 5) M(A, 6)                                        \
    M(B, 7) M(A, 8) M(B, 9) M(A, 10) M(B, 11) M(A, 12) M(B, 13)
// A in registers 0, 3, 6 …, B in the others
#define ONE_TO_TWO(M, A, B)                                                                        \
    M(A, 0) M(B, 1) M(B, 2) M(A, 3) M(B, 4) M(B, 5) M(A, 6)                                        \
    M(B, 7) M(B, 8) M(A, 9) M(B, 10) M(B, 11) M(A, 12) M(B, 13)
// clang-format on

#define IN(MOV, R, I) MOV " " #I "*64(%[in]), %%" R #I "\n\t"
#define OUT(MOV, R, I) MOV " %%" R #I ", " #I "*64(%[out])\n\t"
#define IN_128(MOV, I) IN(MOV, "xmm", I)
#define IN_256(MOV, I) IN(MOV, "ymm", I)
#define IN_512(MOV, I) IN(MOV, "zmm", I)
#define OUT_128(MOV, I) OUT(MOV, "xmm", I)
#define OUT_256(MOV, I) OUT(MOV, "ymm", I)
#define OUT_512(MOV, I) OUT(MOV, "zmm", I)
#define CLOBBERED                                                                                  \
    "xmm0", "xmm1", "xmm2", "xmm3", "xmm4", "xmm5", "xmm6", "xmm7", "xmm8", "xmm9", "xmm10",       \
        "xmm11", "xmm12", "xmm13", "xmm14", "xmm15"

// Wide upper halves left behind would make every legacy instruction after it a merge: vzeroupper.
#define KERNEL(NAME, WIDTH, MOV, END, BODY)                                                        \
    static __attribute__((noinline)) void NAME(long loops, const void *in, void *out) {            \
        __asm__ volatile(                                                                          \
            RUN16(IN_##WIDTH, MOV) ".p2align 6\n1:\n\t" BODY                                       \
                                   "dec %[loops]\n\tjnz 1b\n\t" RUN16(OUT_##WIDTH, MOV) END        \
            : [loops] "+&r"(loops)                                                                 \
            : [in] "r"(in), [out] "r"(out)                                                         \
            : "memory", "cc", CLOBBERED);                                                          \
    }
#define LEGACY(NAME, BODY) KERNEL(NAME, 128, "movups", "", BODY)
#define VEX_128(NAME, BODY) KERNEL(NAME, 128, "vmovups", "", BODY)
#define VEX_256(NAME, BODY) KERNEL(NAME, 256, "vmovups", "vzeroupper", BODY)
#define EVEX_512(NAME, BODY) KERNEL(NAME, 512, "vmovups", "vzeroupper", BODY)

// Repeated by the assembler: ISO C allows literals of 4095 characters.
#define FOUR(BODY) ".rept 4\n\t" BODY ".endr\n\t"
#define SIXTEEN(BODY) ".rept 16\n\t" BODY ".endr\n\t"
// The kinds of one precision and width; P: suffix of the mnemonics (sd, pd, ss, ps).
// clang-format off
#define LEGACY_KERNELS(P)                                                                          \
    VEX_128(fma_##P##_128, FOUR(RUN14(FMA_128, "vfmadd213" #P)))                                   \
    LEGACY(add_##P##_128, FOUR(RUN14(TWO, "add" #P)))                                              \
    LEGACY(mul_##P##_128, FOUR(RUN14(TWO, "mul" #P)))                                              \
    LEGACY(minmax_##P##_128, SIXTEEN(RUN12(MAX_TWO, "max" #P)) TWO("add" #P, 12))                  \
    LEGACY(div_##P##_128, FOUR(RUN14(TWO, "div" #P)))                                              \
    LEGACY(sqrt_##P##_128, FOUR(TEN(UNARY, "sqrt" #P, "xmm") RISE4(TWO, "add" #P)))                \
    LEGACY(add_mul_##P##_128, FOUR(IN_TURN(TWO, "add" #P, "mul" #P)))                              \
    LEGACY(add_2mul_##P##_128, FOUR(ONE_TO_TWO(TWO, "add" #P, "mul" #P)))                          \
    LEGACY(two_add_mul_##P##_128, FOUR(ONE_TO_TWO(TWO, "mul" #P, "add" #P)))
#define WIDE_KERNELS(P, BITS, R, MAKE)                                                             \
    MAKE(fma_##P##_##BITS, FOUR(RUN14(FMA_##BITS, "vfmadd213" #P)))                                \
    MAKE(add_##P##_##BITS, FOUR(RUN14(THREE_##BITS, "vadd" #P)))                                   \
    MAKE(mul_##P##_##BITS, FOUR(RUN14(THREE_##BITS, "vmul" #P)))                                   \
    MAKE(minmax_##P##_##BITS, SIXTEEN(RUN12(MAX_##BITS, "vmax" #P)) THREE_##BITS("vadd" #P, 12))   \
    MAKE(div_##P##_##BITS, FOUR(RUN14(THREE_##BITS, "vdiv" #P)))                                   \
    MAKE(sqrt_##P##_##BITS, FOUR(TEN(UNARY, "vsqrt" #P, R) RISE4(THREE_##BITS, "vadd" #P)))        \
    MAKE(add_mul_##P##_##BITS, FOUR(IN_TURN(THREE_##BITS, "vadd" #P, "vmul" #P)))                  \
    MAKE(add_2mul_##P##_##BITS, FOUR(ONE_TO_TWO(THREE_##BITS, "vadd" #P, "vmul" #P)))              \
    MAKE(two_add_mul_##P##_##BITS, FOUR(ONE_TO_TWO(THREE_##BITS, "vmul" #P, "vadd" #P)))
LEGACY_KERNELS(sd) LEGACY_KERNELS(pd) LEGACY_KERNELS(ss) LEGACY_KERNELS(ps)
WIDE_KERNELS(pd, 256, "ymm", VEX_256) WIDE_KERNELS(ps, 256, "ymm", VEX_256)
WIDE_KERNELS(pd, 512, "zmm", EVEX_512) WIDE_KERNELS(ps, 512, "zmm", EVEX_512)
LEGACY(rsqrt_ss_128, FOUR(TEN(UNARY, "rsqrtss", "xmm") RISE4(TWO, "addss")))
LEGACY(rsqrt_ps_128, FOUR(TEN(UNARY, "rsqrtps", "xmm") RISE4(TWO, "addps")))
VEX_256(rsqrt_ps_256, FOUR(TEN(UNARY, "vrsqrtps", "ymm") RISE4(THREE_256, "vaddps")))
EVEX_512(rsqrt_ps_512, FOUR(TEN(UNARY, "vrsqrt14ps", "zmm") RISE4(THREE_512, "vaddps")))
VEX_128(rsqrt_sd_128, FOUR(TEN(SCALAR, "vrsqrt14sd", "xmm") RISE4(THREE_128, "vaddsd")))
VEX_128(rsqrt_pd_128, FOUR(TEN(UNARY, "vrsqrt14pd", "xmm") RISE4(THREE_128, "vaddpd")))
VEX_256(rsqrt_pd_256, FOUR(TEN(UNARY, "vrsqrt14pd", "ymm") RISE4(THREE_256, "vaddpd")))
EVEX_512(rsqrt_pd_512, FOUR(TEN(UNARY, "vrsqrt14pd", "zmm") RISE4(THREE_512, "vaddpd")))

struct compute {
    enum kind kind;
    bool is_double;
    int bits; // of what one instruction works on: the element's where scalar
    void (*run)(long loops, const void *in, void *out);
    const char *needs; // of the CPU beyond x86-64, or NULL
    double tolerance;  // relative; 0: bit for bit
};
// clang-format on

#define NINE(P, BITS, WIDTH, DOUBLE, NEEDS, FMA_NEEDS)                                             \
    {FMA, DOUBLE, BITS, fma_##P##_##WIDTH, FMA_NEEDS, 0},                                          \
        {ADD, DOUBLE, BITS, add_##P##_##WIDTH, NEEDS, 0},                                          \
        {MUL, DOUBLE, BITS, mul_##P##_##WIDTH, NEEDS, 0},                                          \
        {MINMAX, DOUBLE, BITS, minmax_##P##_##WIDTH, NEEDS, 0},                                    \
        {DIV, DOUBLE, BITS, div_##P##_##WIDTH, NEEDS, 0},                                          \
        {SQRT, DOUBLE, BITS, sqrt_##P##_##WIDTH, NEEDS, 0},                                        \
        {ADD_MUL, DOUBLE, BITS, add_mul_##P##_##WIDTH, NEEDS, 0},                                  \
        {ADD_2MUL, DOUBLE, BITS, add_2mul_##P##_##WIDTH, NEEDS, 0},                                \
        {TWO_ADD_MUL, DOUBLE, BITS, two_add_mul_##P##_##WIDTH, NEEDS, 0}
#define RSQRT_ERROR (1.5 / 4096) // of rsqrtss and rsqrtps
#define RSQRT14_ERROR (1.0 / 16384)
static const struct compute COMPUTE[] = {
    NINE(sd, 64, 128, true, NULL, "fma"),
    NINE(pd, 128, 128, true, NULL, "fma"),
    NINE(pd, 256, 256, true, "avx", "fma"),
    NINE(pd, 512, 512, true, "avx512f", "avx512f"),
    NINE(ss, 32, 128, false, NULL, "fma"),
    NINE(ps, 128, 128, false, NULL, "fma"),
    NINE(ps, 256, 256, false, "avx", "fma"),
    NINE(ps, 512, 512, false, "avx512f", "avx512f"),
    {RSQRT, true, 64, rsqrt_sd_128, "avx512f", RSQRT14_ERROR},
    {RSQRT, true, 128, rsqrt_pd_128, "avx512vl", RSQRT14_ERROR},
    {RSQRT, true, 256, rsqrt_pd_256, "avx512vl", RSQRT14_ERROR},
    {RSQRT, true, 512, rsqrt_pd_512, "avx512f", RSQRT14_ERROR},
    {RSQRT, false, 32, rsqrt_ss_128, NULL, RSQRT_ERROR},
    {RSQRT, false, 128, rsqrt_ps_128, NULL, RSQRT_ERROR},
    {RSQRT, false, 256, rsqrt_ps_256, "avx", RSQRT_ERROR},
    {RSQRT, false, 512, rsqrt_ps_512, "avx512f", RSQRT14_ERROR},
};
enum { COMPUTES = sizeof COMPUTE / sizeof *COMPUTE };

static enum form form_of(enum kind kind) {
    return kind == SQRT || kind == RSQRT ? APART : kind == MINMAX ? RISING : CHAINS;
}

static int per_loop(enum kind kind) {
    enum form form = form_of(kind);
    return form == CHAINS ? 14 * TIMES : form == APART ? 10 * TIMES : 192;
}

// The registers, as the lanes of either precision.
union registers {
    double d[REGISTERS][SLOT / 8];
    float f[REGISTERS][SLOT / 4];
};

static double lane(const union registers *r, bool is_double, int at, int i) {
    return is_double ? r->d[at][i] : (double)r->f[at][i];
}

static void set_lane(union registers *r, bool is_double, int at, int i, double value) {
    if (is_double)
        r->d[at][i] = value;
    else
        r->f[at][i] = (float)value;
}

static int lanes_of(const struct compute *c) {
    return c->bits / (c->is_double ? 64 : 32);
}

// Older dividers stop early on quotients of few digits: these operands have all of theirs, in
// every lane.
static const double FACTOR = 1.00001537, ADDEND = 0.3719;

static void start(const struct compute *c, union registers *r) {
    enum form form = form_of(c->kind);
    for (int at = 0; at < REGISTERS; at++)
        for (int i = 0; i < SLOT / (c->is_double ? 8 : 4); i++) {
            double value = 1.0371 + 0.25 * at + 0.0137 * i;
            if (form == RISING && at == 12)
                value = 6 + 0.0137 * i; // above all it is to replace
            if (at == 14)
                value = form != CHAINS || c->kind == ADD ? ADDEND : FACTOR;
            if (at == 15)
                value = ADDEND;
            set_lane(r, c->is_double, at, i, value);
        }
}

// What a register of CHAINS has after one more step. Rounded as the precision at hand rounds.
static double step(const struct compute *c, int at, double x) {
    enum kind kind = c->kind == ADD_MUL       ? (at % 2 ? MUL : ADD)
                     : c->kind == ADD_2MUL    ? (at % 3 ? MUL : ADD)
                     : c->kind == TWO_ADD_MUL ? (at % 3 ? ADD : MUL)
                                              : c->kind;
    double by = c->kind == ADD ? ADDEND : FACTOR;
    if (c->is_double)
        return kind == FMA   ? fma(x, by, ADDEND)
               : kind == ADD ? x + by
               : kind == MUL ? x * by
                             : x / by;
    float y = (float)x, f = (float)by;
    return kind == FMA   ? fmaf(y, f, (float)ADDEND)
           : kind == ADD ? y + f
           : kind == MUL ? y * f
                         : y / f;
}

static double risen(bool is_double, double x, long times) {
    float y = (float)x;
    for (long n = 0; n < times; n++)
        if (is_double)
            x += ADDEND;
        else
            y += (float)ADDEND;
    return is_double ? x : (double)y;
}

// The registers as `loops` of the body must leave them, one operation after the other, in C.
static void expect(const struct compute *c, long loops, const union registers *in,
                   union registers *out) {
    bool d = c->is_double;
    *out = *in;
    for (int i = 0; i < lanes_of(c); i++)
        switch (form_of(c->kind)) {
        case CHAINS:
            for (int at = 0; at < 14; at++) {
                double x = lane(in, d, at, i);
                for (long n = 0; n < TIMES * loops; n++)
                    x = step(c, at, x);
                set_lane(out, d, at, i, x);
            }
            break;
        case APART:
            for (int at = 10; at < 14; at++) {
                double last = risen(d, lane(in, d, at, i), TIMES * loops - 1);
                set_lane(out, d, at, i, risen(d, last, 1));
                for (int t = at - 10; t < 10; t += 4)
                    set_lane(out, d, t, i,
                             c->kind == RSQRT ? 1 / sqrt(last)
                             : d              ? sqrt(last)
                                              : (double)sqrtf((float)last));
            }
            break;
        case RISING: {
            double last = risen(d, lane(in, d, 12, i), loops - 1);
            for (int at = 0; at < 12; at++)
                set_lane(out, d, at, i, last);
            set_lane(out, d, 12, i, risen(d, last, 1));
        }
        }
}

static void name_of(const struct compute *c, char text[64]) {
    snprintf(text, 64, "%s %s %d bits", KIND_NAMES[c->kind], c->is_double ? "double" : "single",
             c->bits);
}

// NaN is wrong. Approximations are judged by their documented error; everything else must be
// right bit for bit.
static bool work_done(const struct compute *c, const union registers *found,
                      const union registers *wanted, bool quiet) {
    for (int at = 0; at < REGISTERS; at++)
        for (int i = 0; i < lanes_of(c); i++) {
            double x = lane(found, c->is_double, at, i), y = lane(wanted, c->is_double, at, i);
            double allowed = at < 10 ? c->tolerance * fabs(y) : 0;
            if (!(fabs(x - y) <= allowed)) {
                char name[64];
                name_of(c, name);
                if (!quiet)
                    fprintf(stderr,
                            "ceilings: %s: register %d, lane %d is %.17g, must be %.17g: the "
                            "kernel did not do its work\n",
                            name, at, i, x, y);
                return false;
            }
        }
    return true;
}

// --- kernels of bandwidth ---
//
// `loops` blocks of 16 accesses each, one after the other through a window (a power of two of
// bytes) from `offset` on and round again: without an inner loop there is no end of it to
// mispredict. Returns the next offset. Registers as above.
enum motion { LOAD, STORE, COPY, MOTIONS };
static const char *const MOTION_NAMES[MOTIONS] = {"load", "store", "copy"};

#define LOAD_AT(MOV, R, BYTES, I) MOV " " #I "*" #BYTES "(%[p]), %%" R #I "\n\t"
#define STORE_AT(MOV, R, BYTES, I) MOV " %%" R #I ", " #I "*" #BYTES "(%[p])\n\t"
#define STORE_FAR(MOV, R, BYTES, I) MOV " %%" R #I ", " #I "*" #BYTES "(%[p],%[apart])\n\t"
#define COPY_AT(MOV, R, BYTES, I) LOAD_AT(MOV, R, BYTES, I) STORE_FAR(MOV, R, BYTES, I)
// clang-format off
#define ALL(M, MOV, R, BYTES)                                                   \
    M(MOV, R, BYTES, 0) M(MOV, R, BYTES, 1) M(MOV, R, BYTES, 2)                 \
    M(MOV, R, BYTES, 3) M(MOV, R, BYTES, 4) M(MOV, R, BYTES, 5)                 \
    M(MOV, R, BYTES, 6) M(MOV, R, BYTES, 7) M(MOV, R, BYTES, 8)                 \
    M(MOV, R, BYTES, 9) M(MOV, R, BYTES, 10) M(MOV, R, BYTES, 11)               \
    M(MOV, R, BYTES, 12) M(MOV, R, BYTES, 13) M(MOV, R, BYTES, 14)              \
    M(MOV, R, BYTES, 15)
// clang-format on
struct window {
    char *base;
    ptrdiff_t apart; // from what a copy reads to what it writes
    size_t mask, offset;
};
#define MOTION(NAME, WIDTH, WHOLE, END, BYTES, BODY)                                               \
    static __attribute__((noinline)) void NAME(long loops, struct window *w, const void *in,       \
                                               void *out) {                                        \
        char *p;                                                                                   \
        size_t offset = w->offset;                                                                 \
        __asm__ volatile(                                                                          \
            RUN16(IN_##WIDTH, WHOLE) ".p2align 6\n1:\n\t"                                          \
                                     "lea (%[base],%[offset]), %[p]\n\t"                           \
                                     "add $16*" #BYTES ", %[offset]\n\t"                           \
                                     "and %[mask], %[offset]\n\t" BODY                             \
                                     "dec %[loops]\n\tjnz 1b\n\t" RUN16(OUT_##WIDTH, WHOLE) END    \
            : [loops] "+&r"(loops), [offset] "+&r"(offset), [p] "=&r"(p)                           \
            : [in] "r"(in), [out] "r"(out), [base] "r"(w->base), [apart] "r"(w->apart),            \
              [mask] "r"(w->mask)                                                                  \
            : "memory", "cc", CLOBBERED);                                                          \
        w->offset = offset;                                                                        \
    }
#define THREE(BITS, WIDTH, WHOLE, END, MOV, R, BYTES)                                              \
    MOTION(load_##BITS, WIDTH, WHOLE, END, BYTES, ALL(LOAD_AT, MOV, R, BYTES))                     \
    MOTION(store_##BITS, WIDTH, WHOLE, END, BYTES, ALL(STORE_AT, MOV, R, BYTES))                   \
    MOTION(copy_##BITS, WIDTH, WHOLE, END, BYTES, ALL(COPY_AT, MOV, R, BYTES))
THREE(64, 128, "movups", "", "movsd", "xmm", 8)
THREE(128, 128, "movups", "", "movups", "xmm", 16)
THREE(256, 256, "vmovups", "vzeroupper", "vmovups", "ymm", 32)
THREE(512, 512, "vmovups", "vzeroupper", "vmovups", "zmm", 64)

struct moving {
    enum motion motion;
    int bits;
    void (*run)(long loops, struct window *w, const void *in, void *out);
    const char *needs;
};
#define MOVING(BITS, NEEDS)                                                                        \
    {LOAD, BITS, load_##BITS, NEEDS}, {STORE, BITS, store_##BITS, NEEDS}, {                        \
        COPY, BITS, copy_##BITS, NEEDS                                                             \
    }
static const struct moving MOVINGS[] = {MOVING(64, NULL), MOVING(128, NULL), MOVING(256, "avx"),
                                        MOVING(512, "avx512f")};
enum { KINDS_OF_MOVING = sizeof MOVINGS / sizeof *MOVINGS, BLOCK = 16 };

// A place's content: no two words alike, so that a wrong address shows.
static uint64_t word_at(size_t index) {
    return 0x9e3779b97f4a7c15u * (index + 1);
}

static bool complain_of(const struct moving *m, const char *what, size_t at, bool quiet) {
    if (!quiet)
        fprintf(stderr,
                "ceilings: %s %d bits: wrong %s at byte %zu: the kernel did not do its work\n",
                MOTION_NAMES[m->motion], m->bits, what, at);
    return false;
}

// Runs `loops` blocks in a small window of known content and looks at every byte: what was moved,
// from where to where, and that nothing else was touched. `window`: 4 KiB; `pretend`: blocks that
// should have been moved.
static bool moves_rightly(const struct moving *m, long loops, long pretend, bool quiet) {
    enum { WINDOW = 4096, WORDS = WINDOW / 8 };
    _Alignas(64) static uint64_t memory[2 * WORDS], wanted[2 * WORDS];
    _Alignas(64) static union {
        uint64_t words[REGISTERS][SLOT / 8];
    } in, out, last;
    size_t bytes = (size_t)m->bits / 8;
    for (size_t i = 0; i < 2 * WORDS; i++)
        wanted[i] = memory[i] = word_at(i);
    for (size_t i = 0; i < REGISTERS * SLOT / 8; i++)
        last.words[i / 8][i % 8] = in.words[i / 8][i % 8] = word_at(i + 1000000);
    struct window w = {(char *)memory, WINDOW, WINDOW - 1, 0};
    m->run(loops, &w, &in, &out);
    for (long block = 0; block < pretend; block++)
        for (size_t i = 0; i < BLOCK; i++) {
            size_t at = ((size_t)block * BLOCK + i) * bytes % WINDOW;
            if (m->motion != STORE)
                memcpy(last.words[i], (char *)wanted + at, bytes);
            if (m->motion != LOAD)
                memcpy((char *)wanted + at + (m->motion == COPY ? WINDOW : 0), last.words[i],
                       bytes);
        }
    for (size_t i = 0; i < REGISTERS; i++)
        if (memcmp(out.words[i], last.words[i], bytes) != 0)
            return complain_of(m, "register", i, quiet);
    for (size_t i = 0; i < 2 * WORDS; i++)
        if (memory[i] != wanted[i])
            return complain_of(m, "memory", 8 * i, quiet);
    if (w.offset != (size_t)pretend * BLOCK * bytes % WINDOW)
        return complain_of(m, "offset", w.offset, quiet);
    return true;
}

// --- this machine ---

static bool has(const char *feature) {
    const char *limit = getenv("STEPWISE_ISA_LIMIT"); // as for the driver
    if (!feature)
        return true;
    if (limit && strcmp(limit, "none") == 0)
        return false;
    if (limit && strcmp(limit, "avx2") == 0 && strncmp(feature, "avx512", 6) == 0)
        return false;
    __builtin_cpu_init();
    return (strcmp(feature, "avx") == 0 && __builtin_cpu_supports("avx")) ||
           (strcmp(feature, "fma") == 0 && __builtin_cpu_supports("fma")) ||
           (strcmp(feature, "avx512f") == 0 && __builtin_cpu_supports("avx512f")) ||
           (strcmp(feature, "avx512vl") == 0 && __builtin_cpu_supports("avx512vl"));
}

// A word of sysfs about one cache of CPU 0; "" where there is none.
static void cache_word(int index, const char *name, char word[32]) {
    char path[96];
    word[0] = '\0';
    snprintf(path, sizeof path, "/sys/devices/system/cpu/cpu0/cache/index%d/%s", index, name);
    FILE *file = fopen(path, "r");
    if (!file)
        return;
    if (fscanf(file, "%31s", word) != 1)
        word[0] = '\0';
    fclose(file);
}

// Bytes of the data or unified cache of that level, by Linux's sysfs, else by the C library;
// 0: unknown.
static size_t cache_bytes(int level) {
    for (int index = 0; index < 8; index++) {
        char found[32], type[32], size[32];
        cache_word(index, "level", found);
        cache_word(index, "type", type);
        cache_word(index, "size", size);
        long kib = atol(size); // sysfs writes "48K"
        if (atoi(found) == level && kib > 0 && strcmp(type, "Instruction") != 0)
            return (size_t)kib << 10;
    }
    long bytes = sysconf(level == 1   ? _SC_LEVEL1_DCACHE_SIZE
                         : level == 2 ? _SC_LEVEL2_CACHE_SIZE
                                      : _SC_LEVEL3_CACHE_SIZE);
    return bytes > 0 ? (size_t)bytes : 0;
}

static size_t power_of_two(double bytes) {
    size_t power = 4096;
    while (2.0 * (double)power <= bytes)
        power *= 2;
    return power;
}

enum level { L1, L2, L3, MEMORY, LEVELS };
static const char *const LEVEL_NAMES[LEVELS] = {"L1", "L2", "L3", "memory"};

struct place {
    size_t cache, working_set; // bytes; working_set 0: left out, `why`
    const char *why, *rule;
};

// Half of L1 and of L2. L3 is shared, and a virtual machine is told the size of the whole socket's,
// of which it has no claim to half: the geometric mean of L2 and L3 is far above the one and far
// below the other. Memory: four times L3, but at most 512 MiB and a quarter of what there is.
// Powers of two, downwards.
static void find_places(struct place places[LEVELS]) {
    size_t l1 = cache_bytes(1), l2 = cache_bytes(2), l3 = cache_bytes(3);
    double ram = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    double most = fmin(512.0 * 1048576, ram / 4), four = 4.0 * (double)(l3 ? l3 : l2);
    places[L1] = (struct place){l1, l1 ? power_of_two((double)l1 / 2) : 0, NULL, "half of L1"};
    places[L2] = (struct place){l2, l2 ? power_of_two((double)l2 / 2) : 0, NULL, "half of L2"};
    places[L3] =
        (struct place){l3, l2 && l3 > 2 * l2 ? power_of_two(sqrt((double)l2 * (double)l3)) : 0,
                       NULL, "geometric mean of L2 and L3"};
    places[MEMORY] =
        (struct place){0, 0, NULL, "four times L3, at most 512 MiB and a quarter of memory"};
    places[MEMORY].working_set = l2 || l3 ? power_of_two(fmin(four, most)) : power_of_two(most);
    for (int i = 0; i < LEVELS; i++)
        if (!places[i].working_set)
            places[i].why = "the system does not say how large this cache is, or it has none";
    if (l3 && places[MEMORY].working_set <= l3) {
        places[MEMORY].working_set = 0;
        places[MEMORY].why = "a quarter of memory would still fit into L3";
    }
}

// --- samples ---

enum { ROUNDS = 5, MOST_SAMPLES = 1000 };

struct clocks {
    double tsc_hz;
    uint64_t overhead;
};

struct samples {
    double per_cycle[MOST_SAMPLES], per_second[MOST_SAMPLES], hz[MOST_SAMPLES];
    int count;
};

static double seconds_of(const struct clocks *clocks, uint64_t ticks) {
    return (double)(ticks > clocks->overhead ? ticks - clocks->overhead : 1) / clocks->tsc_hz;
}

// One round: `one` is timed until `count` samples are good, each with a chain of adds (33 us at 3
// GHz) before and after it. Dense 512-bit FMAs lower some clocks by more than the one FMA per cycle
// of timer_core_hz_under_load does, and a clock takes longer to come back than the chain lasts: so
// it is the chains right beside the sample that count. Where they differ, the clock moved or one of
// them was disturbed (a busy hyper-thread slows it by 10 to 20 %, never twice alike): what a cycle
// was is not known, no sample.
//
// `warm`: what is timed runs once untimed before. After the scalar chain the first microseconds of
// 512-bit code are slow, while the core brings its upper halves up: without this the ceilings of
// FMA, add and mul at 512 bits came out 2 to 5 % low. From memory it would only be in the way.
static void sample(struct samples *s, const struct clocks *clocks, void (*one)(void *), void *what,
                   bool warm, double work, int count) {
    double before = timer_core_hz(clocks->tsc_hz, 1);
    for (int tries = 0, good = 0; tries < 8 * count && good < count && s->count < MOST_SAMPLES;
         tries++) {
        if (warm)
            one(what);
        uint64_t begin = timer_tsc_begin();
        one(what);
        double seconds = seconds_of(clocks, timer_tsc_end() - begin);
        double after = timer_core_hz(clocks->tsc_hz, 1);
        if (fabs(after / before - 1) < 0.003) {
            s->per_second[s->count] = work / seconds;
            s->hz[s->count] = (before + after) / 2;
            s->per_cycle[s->count] = work / seconds / s->hz[s->count];
            s->count++;
            good++;
        }
        before = after;
    }
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

struct summary {
    double best, median, low, high, worst, per_second, hz;
};

enum { REPEATED = 3 };

// The highest of `n` ascending values that has two more within 1 % below it, or else the median.
static double repeated(const double *v, int n) {
    double median = n % 2 ? v[n / 2] : (v[n / 2 - 1] + v[n / 2]) / 2;
    for (int i = n - 1; i >= REPEATED - 1 && v[i] > median; i--)
        if (v[i - (REPEATED - 1)] >= 0.99 * v[i])
            return v[i];
    return median;
}

// 95 % interval of the median by order statistics (binomial, normal approximation): W. J. Conover,
// Practical Nonparametric Statistics, 3rd ed. (1999), section 3.2.
static struct summary summarize(struct samples *s) {
    int n = s->count;
    qsort(s->per_cycle, (size_t)n, sizeof *s->per_cycle, ascending);
    qsort(s->per_second, (size_t)n, sizeof *s->per_second, ascending);
    qsort(s->hz, (size_t)n, sizeof *s->hz, ascending);
    int low = (int)floor(n / 2.0 - 0.98 * sqrt(n)), high = (int)ceil(n / 2.0 + 0.98 * sqrt(n));
    const double *v = s->per_cycle;
    return (struct summary){.best = repeated(v, n),
                            .median = n % 2 ? v[n / 2] : (v[n / 2 - 1] + v[n / 2]) / 2,
                            .low = v[low < 0 ? 0 : low],
                            .high = v[high > n - 1 ? n - 1 : high],
                            .worst = v[0],
                            .per_second = repeated(s->per_second, n),
                            .hz = s->hz[n / 2]};
}

static const double SAMPLE_SECONDS =
    60e-6; // far below a time slice: the best one was not interrupted

struct computing {
    long loops; // of a sample
    union registers in, wanted;
    struct samples samples;
};

static void plan(const struct compute *c, struct computing *p, const struct clocks *clocks) {
    enum { TRIAL = 50, MOST = 10000 }; // MOST: the operands stay near where they were
    union registers out;
    start(c, &p->in);
    uint64_t least = UINT64_MAX;
    for (int i = 0; i < 5; i++) {
        uint64_t begin = timer_tsc_begin();
        c->run(TRIAL, &p->in, &out);
        uint64_t ticks = timer_tsc_end() - begin;
        least = ticks < least ? ticks : least;
    }
    double loops = TRIAL * SAMPLE_SECONDS / seconds_of(clocks, least);
    p->loops = loops < TRIAL ? TRIAL : loops > MOST ? MOST : (long)loops;
    expect(c, p->loops, &p->in, &p->wanted);
}

struct computation {
    const struct compute *compute;
    struct computing *plan;
    union registers out;
    bool wrong;
};

static void compute_once(void *what) {
    struct computation *c = what;
    c->compute->run(c->plan->loops, &c->plan->in, &c->out);
}

static bool measure_compute(const struct compute *c, struct computing *p,
                            const struct clocks *clocks, int count) {
    struct computation one = {.compute = c, .plan = p};
    for (uint64_t begin = timer_ns(); timer_ns() - begin < 3000000;)
        compute_once(&one);
    // All samples are alike: what the last one left behind is what the others did.
    double flops = (double)p->loops * per_loop(c->kind) * lanes_of(c) * (c->kind == FMA ? 2 : 1);
    sample(&p->samples, clocks, compute_once, &one, true, flops, count);
    return work_done(c, &one.out, &p->wanted, false);
}

static int loop_bytes(const struct moving *m) {
    return BLOCK * m->bits / 8 * (m->motion == COPY ? 2 : 1);
}

struct transfer {
    const struct moving *moving;
    struct window window;
    long loops;
    struct samples samples;
};

static void move_once(void *what) {
    static _Alignas(64) union registers in, out;
    struct transfer *t = what;
    t->moving->run(t->loops, &t->window, &in, &out);
}

// A sample moves half of 1 MiB from L1 and L2, else 4 MiB; copies count what they read and what
// they write. From memory every sample of every kernel goes on where the last one stopped
// (`position`), so that nothing comes back before the whole of the working set has passed.
static void measure_transfer(enum level level, struct transfer *t, size_t *position,
                             const struct clocks *clocks, int count) {
    const struct moving *m = t->moving;
    size_t per_block = BLOCK * (size_t)m->bits / 8;
    if (level == MEMORY) {
        t->window.offset = *position & t->window.mask;
    } else {
        t->loops = (long)(2 * (t->window.mask + 1) / per_block);
        move_once(t);
    }
    t->loops = (long)((level <= L2 ? (size_t)512 << 10 : (size_t)4 << 20) / per_block);
    move_once(t);
    double moved = (double)t->loops * loop_bytes(m);
    sample(&t->samples, clocks, move_once, t, level != MEMORY, moved, count);
    if (level == MEMORY)
        *position += (size_t)(count + 1) * (size_t)t->loops * per_block;
}

// --- output ---

static const char *const UNSTEADY = "the core clock never held still long enough";

static void print_missing(const char *unit, const char *why, const char *needs) {
    printf("\"value\": null, \"unit\": \"%s/core cycle\", \"reason\": \"%s%s\"}", unit, why,
           needs ? needs : "");
}

static void print_spread(struct samples *s, const char *unit, double instruction) {
    if (s->count < REPEATED) {
        print_missing(unit, UNSTEADY, NULL);
        return;
    }
    struct summary v = summarize(s);
    printf("\"value\": %.6g, \"unit\": \"%s/core cycle\", \"median\": %.6g, \"low\": %.6g, "
           "\"high\": %.6g, "
           "\"worst\": %.6g, \"samples\": %d, \"per_second\": %.6g, "
           "\"instructions_per_core_cycle\": %.6g, "
           "\"core_hz\": %.6g}",
           v.best, unit, v.median, v.low, v.high, v.worst, s->count, v.per_second,
           v.best / instruction, v.hz);
}

static void row(const char *name, const char *what, struct samples *s, const char *unit) {
    if (s->count < REPEATED) {
        printf("%-8s %-22s %s\n", name, what, UNSTEADY);
        return;
    }
    struct summary v = summarize(s);
    printf("%-8s %-22s %8.4g %s/core cycle (median %.4g [%.4g, %.4g], worst %.4g, n = %d), %.4g "
           "G/s\n",
           name, what, v.best, unit, v.median, v.low, v.high, v.worst, s->count,
           v.per_second / 1e9);
}

static const char *const LACKS = "this CPU lacks ";

// --- the program ---

// Every kernel does its work, and does not when it ran once less or from another start: a check
// that cannot fail checks nothing.
static int check(void) {
    int kernels = 0, wrong = 0;
    for (int k = 0; k < COMPUTES; k++) {
        const struct compute *c = &COMPUTE[k];
        if (!has(c->needs))
            continue;
        kernels++;
        const long counts[] = {1, 2, 7, 300};
        char name[64];
        name_of(c, name);
        for (int i = 0; i < 4; i++) {
            union registers in, out, wanted;
            start(c, &in);
            expect(c, counts[i], &in, &wanted);
            c->run(counts[i], &in, &out);
            wrong += !work_done(c, &out, &wanted, false);
            c->run(counts[i] + 1, &in, &out);
            if (work_done(c, &out, &wanted, true) && ++wrong)
                fprintf(stderr, "ceilings: %s: %ld loops pass for %ld\n", name, counts[i] + 1,
                        counts[i]);
            enum form form = form_of(c->kind);
            int at = form == CHAINS  ? (int)counts[i] % 14
                     : form == APART ? 10 + (int)counts[i] % 4
                                     : 12;
            int odd = lanes_of(c) - 1;
            set_lane(&in, c->is_double, at, odd, lane(&in, c->is_double, at, odd) + 0.5);
            c->run(counts[i], &in, &out);
            if (work_done(c, &out, &wanted, true) && ++wrong)
                fprintf(stderr, "ceilings: %s: another start of register %d passes\n", name, at);
        }
    }
    for (int k = 0; k < KINDS_OF_MOVING; k++) {
        const struct moving *m = &MOVINGS[k];
        if (!has(m->needs))
            continue;
        kernels++;
        const long counts[] = {1, 3, 130};
        for (int i = 0; i < 3; i++) {
            wrong += !moves_rightly(m, counts[i], counts[i], false);
            if (moves_rightly(m, counts[i] + 1, counts[i], true) && ++wrong)
                fprintf(stderr, "ceilings: %s %d bits: %ld blocks pass for %ld\n",
                        MOTION_NAMES[m->motion], m->bits, counts[i] + 1, counts[i]);
        }
    }
    printf("%d kernels checked, %d wrong\n", kernels, wrong);
    return wrong ? WRONG_WORK : OK;
}

static int usage(FILE *file, int status) {
    fputs(
        "usage: ceilings [--json] [--check] [--samples N]\n"
        "  Ceilings of one core: arithmetic and bandwidth, per core cycle and per second.\n"
        "  --json       one JSON object on standard output\n"
        "  --check      whether every kernel does its work, and a wrong one is noticed; no timing\n"
        "  --samples N  of each ceiling, 5 to 1000 (30), in 5 rounds\n"
        "exit status: 0 done; 1 a kernel did not do its work; 2 bad arguments; 5 out of memory\n",
        file);
    return status;
}

int main(int argc, char **argv) {
    bool json = false, only_check = false;
    int samples = 30;
    for (int i = 1; i < argc; i++) {
        char *end = NULL;
        if (strcmp(argv[i], "--json") == 0)
            json = true;
        else if (strcmp(argv[i], "--check") == 0)
            only_check = true;
        else if (strcmp(argv[i], "-h") == 0 || strcmp(argv[i], "--help") == 0)
            return usage(stdout, OK);
        else if (strcmp(argv[i], "--samples") == 0 && i + 1 < argc) {
            long value = strtol(argv[++i], &end, 10);
            if (*end || end == argv[i] || value < 5 || value > MOST_SAMPLES) {
                fprintf(stderr, "ceilings: --samples: 5 to %d is required, not \"%s\"\n",
                        MOST_SAMPLES, argv[i]);
                return BAD_INPUT;
            }
            samples = (int)value;
        } else {
            fprintf(stderr, "ceilings: %s: unknown option, or its value is missing\n", argv[i]);
            return usage(stderr, BAD_INPUT);
        }
    }
    if (only_check)
        return check();

    uint64_t begin = timer_ns();
    struct clocks clocks = {timer_tsc_hz(50), timer_overhead_cycles()};
    struct place places[LEVELS];
    find_places(places);
    struct computing *computing = calloc(COMPUTES, sizeof *computing);
    struct transfer *transfers = calloc(LEVELS * KINDS_OF_MOVING, sizeof *transfers);
    size_t largest = 0;
    for (int level = 0; level < LEVELS; level++)
        largest = places[level].working_set > largest ? places[level].working_set : largest;
    // Huge pages where the kernel gives them: what is measured are caches, not the TLB.
    // The window of memory begins behind that of L3, whose lines are still in the cache.
    size_t huge = (size_t)2 << 20, front = (places[L3].working_set + 2 * huge) / huge * huge;
    size_t room = (front + largest + 3 * huge) / huge * huge;
    char *memory = aligned_alloc(huge, room);
    if (!computing || !transfers || !memory) {
        fprintf(stderr, "ceilings: out of memory: %zu MiB are needed\n", room >> 20);
        free(memory);
        free(transfers);
        free(computing);
        return OUT_OF_MEMORY;
    }
    madvise(memory, room, MADV_HUGEPAGE);
    for (size_t i = 0; i < room / 8; i++)
        ((uint64_t *)(void *)memory)[i] = word_at(i);

    int status = OK;
    for (int k = 0; k < COMPUTES; k++)
        if (has(COMPUTE[k].needs))
            plan(&COMPUTE[k], &computing[k], &clocks);
    for (int level = 0; level < LEVELS; level++)
        for (int k = 0; k < KINDS_OF_MOVING; k++) {
            // A copy's two halves make up the working set, 2 KiB + 64 off the same place in a page:
            // a load that seems to depend on a store of another page would wait for it
            // (4 KiB aliasing).
            size_t set = places[level].working_set,
                   window = MOVINGS[k].motion == COPY ? set / 2 : set;
            if (!set || !has(MOVINGS[k].needs))
                continue;
            transfers[level * KINDS_OF_MOVING + k] =
                (struct transfer){.moving = &MOVINGS[k],
                                  .window = {level == MEMORY ? memory + front : memory,
                                             (ptrdiff_t)window + 2048 + 64, window - 1, 0}};
            status = status ? status : !moves_rightly(&MOVINGS[k], 130, 130, false);
        }
    size_t position = 0;
    // In rounds, so that a neighbour who is busy for a second spoils no ceiling's every sample.
    for (int round = 0; round < ROUNDS && status == OK; round++) {
        int count = samples * (round + 1) / ROUNDS - samples * round / ROUNDS;
        for (int k = 0; k < COMPUTES && status == OK; k++)
            if (has(COMPUTE[k].needs) &&
                !measure_compute(&COMPUTE[k], &computing[k], &clocks, count))
                status = WRONG_WORK;
        for (int level = 0; level < LEVELS; level++)
            for (int k = 0; k < KINDS_OF_MOVING; k++)
                if (places[level].working_set && has(MOVINGS[k].needs))
                    measure_transfer((enum level)level, &transfers[level * KINDS_OF_MOVING + k],
                                     &position, &clocks, count);
    }
    if (status == OK) {
        double core_hz = timer_core_hz(clocks.tsc_hz, 8);
        if (json) {
            printf("{\"schema\": 1, \"compiler\": \"" __VERSION__
                   "\", \"tsc_hz\": %.10g, \"core_hz\": %.6g, \"core_hz_load\": {",
                   clocks.tsc_hz, core_hz);
            for (int bits = 128; bits <= 512; bits *= 2) {
                double hz = timer_core_hz_under_load(clocks.tsc_hz, 8, bits);
                printf("%s\"%d\": ", bits > 128 ? ", " : "", bits);
                printf(hz > 0 ? "%.6g" : "null", hz);
            }
            printf("}, \"timer_overhead_cycles\": %d, \"cache_bytes\": {\"L1\": %zu, \"L2\": %zu, "
                   "\"L3\": "
                   "%zu}, \"estimate\": \"value: the best that was seen three times; median, low "
                   "and high: "
                   "median and "
                   "its 95 %% interval\", \"ceilings\": [",
                   (int)clocks.overhead, places[L1].cache, places[L2].cache, places[L3].cache);
        } else {
            printf("TSC %.4f GHz, core %.3f GHz; best of %d samples\n", clocks.tsc_hz / 1e9,
                   core_hz / 1e9, samples);
        }
        const char *between = "\n";
        for (int k = 0; k < COMPUTES; k++) {
            const struct compute *c = &COMPUTE[k];
            int flops = lanes_of(c) * (c->kind == FMA ? 2 : 1);
            if (json) {
                printf("%s{\"name\": \"%s\", \"precision\": \"%s\", \"bits\": %d, "
                       "\"loop_operations\": %d, ",
                       between, KIND_NAMES[c->kind], c->is_double ? "double" : "single", c->bits,
                       per_loop(c->kind));
                if (has(c->needs))
                    print_spread(&computing[k].samples, "flop", flops);
                else
                    print_missing("flop", LACKS, c->needs);
                between = ",\n";
            } else if (has(c->needs)) {
                char what[64];
                snprintf(what, sizeof what, "%s %d bits", c->is_double ? "double" : "single",
                         c->bits);
                row(KIND_NAMES[c->kind], what, &computing[k].samples, "flop");
            } else {
                printf("%-8s %d bits: %s%s\n", KIND_NAMES[c->kind], c->bits, LACKS, c->needs);
            }
        }
        for (int level = 0; level < LEVELS; level++)
            for (int k = 0; k < KINDS_OF_MOVING; k++) {
                const struct moving *m = &MOVINGS[k];
                const struct place *place = &places[level];
                struct samples *s = &transfers[level * KINDS_OF_MOVING + k].samples;
                const char *name = MOTION_NAMES[m->motion];
                bool here = place->working_set && has(m->needs);
                if (json) {
                    printf(
                        "%s{\"name\": \"%s\", \"level\": \"%s\", \"bits\": %d, "
                        "\"loop_bytes\": %d, \"working_set_bytes\": %zu, \"working_set\": \"%s\", ",
                        between, name, LEVEL_NAMES[level], m->bits, loop_bytes(m),
                        place->working_set, place->rule);
                    if (here)
                        print_spread(s, "byte", m->bits / 8.0); // a copy: two instructions
                    else if (place->working_set)
                        print_missing("byte", LACKS, m->needs);
                    else
                        print_missing("byte", place->why, NULL);
                } else if (here) {
                    char what[64];
                    snprintf(what, sizeof what, "%s %d bits", LEVEL_NAMES[level], m->bits);
                    row(name, what, s, "byte");
                } else {
                    printf("%-8s %s %d bits: %s%s\n", name, LEVEL_NAMES[level], m->bits,
                           place->working_set ? LACKS : place->why,
                           place->working_set ? m->needs : "");
                }
            }
        if (json)
            printf("\n], \"seconds\": %.3f}\n", (double)(timer_ns() - begin) / 1e9);
        if (fflush(stdout) != 0 || ferror(stdout)) {
            fprintf(stderr, "ceilings: standard output cannot be written: %s\n", strerror(errno));
            status = BAD_INPUT;
        }
    }
    free(memory);
    free(transfers);
    free(computing);
    return status;
}
