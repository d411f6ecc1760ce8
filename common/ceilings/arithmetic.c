// The arithmetic kernels of x86-64 in assembly. See arithmetic.h.
#include "arithmetic.h"

#include <stdio.h>

const char *const KIND_NAMES[KINDS] = {"fma",  "add",   "mul",     "minmax",   "div",
                                       "sqrt", "rsqrt", "add+mul", "add+2mul", "2add+mul"};

#ifdef __x86_64__
// x = x op register 14
#define TWO(OP, I) OP " %%xmm14, %%xmm" #I "\n\t"
#define THREE_128(OP, I) OP " %%xmm14, %%xmm" #I ", %%xmm" #I "\n\t"
#define THREE_256(OP, I) OP " %%ymm14, %%ymm" #I ", %%ymm" #I "\n\t"
#define THREE_512(OP, I) OP " %%zmm14, %%zmm" #I ", %%zmm" #I "\n\t"
// x = x · register 14 + register 15
#define FMA_128(OP, I) OP " %%xmm15, %%xmm14, %%xmm" #I "\n\t"
#define FMA_256(OP, I) OP " %%ymm15, %%ymm14, %%ymm" #I "\n\t"
#define FMA_512(OP, I) OP " %%zmm15, %%zmm14, %%zmm" #I "\n\t"
// x = max(x, register 12)
#define MAX_TWO(OP, I) OP " %%xmm12, %%xmm" #I "\n\t"
#define MAX_256(OP, I) OP " %%ymm12, %%ymm" #I ", %%ymm" #I "\n\t"
#define MAX_512(OP, I) OP " %%zmm12, %%zmm" #I ", %%zmm" #I "\n\t"
// t = op(x); SCALAR: with three operands, where the upper part comes from the source
#define UNARY(OP, R, T, X) OP " %%" R #X ", %%" R #T "\n\t"
#define SCALAR(OP, R, T, X) OP " %%" R #X ", %%" R #X ", %%" R #T "\n\t"
// clang-format off
#define FOR_10(M, OP, R)                                                                              \
    M(OP, R, 0, 10) M(OP, R, 1, 11) M(OP, R, 2, 12) M(OP, R, 3, 13) M(OP, R, 4, 10)                \
    M(OP, R, 5, 11) M(OP, R, 6, 12) M(OP, R, 7, 13) M(OP, R, 8, 10) M(OP, R, 9, 11)
#define ADD_TO_4(M, OP) M(OP, 10) M(OP, 11) M(OP, 12) M(OP, 13)
// Operation A in registers 0, 2, 4 …, B in the others.
#define ALTERNATE(M, A, B)                                                                           \
    M(A, 0) M(B, 1) M(A, 2) M(B, 3) M(A, 4) M(B, 5) M(A, 6)                                        \
    M(B, 7) M(A, 8) M(B, 9) M(A, 10) M(B, 11) M(A, 12) M(B, 13)
// Operation A in registers 0, 3, 6 …, B in the others.
#define ONE_TO_TWO(M, A, B)                                                                        \
    M(A, 0) M(B, 1) M(B, 2) M(A, 3) M(B, 4) M(B, 5) M(A, 6)                                        \
    M(B, 7) M(B, 8) M(A, 9) M(B, 10) M(B, 11) M(A, 12) M(B, 13)
// clang-format on

// Wide kernels end with vzeroupper. With dirty upper halves every later legacy instruction would have
// to merge with the old register value.
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

// The assembler repeats the body: ISO C limits string literals to 4095 characters.
#define FOUR(BODY) ".rept 4\n\t" BODY ".endr\n\t"
#define SIXTEEN(BODY) ".rept 16\n\t" BODY ".endr\n\t"
// All kinds of one precision and width; P is the suffix of the mnemonics (sd, pd, ss, ps).
// clang-format off
#define LEGACY_KERNELS(P)                                                                          \
    VEX_128(fma_##P##_128, FOUR(RUN14(FMA_128, "vfmadd213" #P)))                                   \
    LEGACY(add_##P##_128, FOUR(RUN14(TWO, "add" #P)))                                              \
    LEGACY(mul_##P##_128, FOUR(RUN14(TWO, "mul" #P)))                                              \
    LEGACY(minmax_##P##_128, SIXTEEN(RUN12(MAX_TWO, "max" #P)) TWO("add" #P, 12))                  \
    LEGACY(div_##P##_128, FOUR(RUN14(TWO, "div" #P)))                                              \
    LEGACY(sqrt_##P##_128, FOUR(FOR_10(UNARY, "sqrt" #P, "xmm") ADD_TO_4(TWO, "add" #P)))                \
    LEGACY(add_mul_##P##_128, FOUR(ALTERNATE(TWO, "add" #P, "mul" #P)))                              \
    LEGACY(add_2mul_##P##_128, FOUR(ONE_TO_TWO(TWO, "add" #P, "mul" #P)))                          \
    LEGACY(two_add_mul_##P##_128, FOUR(ONE_TO_TWO(TWO, "mul" #P, "add" #P)))
#define WIDE_KERNELS(P, BITS, R, MAKE)                                                             \
    MAKE(fma_##P##_##BITS, FOUR(RUN14(FMA_##BITS, "vfmadd213" #P)))                                \
    MAKE(add_##P##_##BITS, FOUR(RUN14(THREE_##BITS, "vadd" #P)))                                   \
    MAKE(mul_##P##_##BITS, FOUR(RUN14(THREE_##BITS, "vmul" #P)))                                   \
    MAKE(minmax_##P##_##BITS, SIXTEEN(RUN12(MAX_##BITS, "vmax" #P)) THREE_##BITS("vadd" #P, 12))   \
    MAKE(div_##P##_##BITS, FOUR(RUN14(THREE_##BITS, "vdiv" #P)))                                   \
    MAKE(sqrt_##P##_##BITS, FOUR(FOR_10(UNARY, "vsqrt" #P, R) ADD_TO_4(THREE_##BITS, "vadd" #P)))        \
    MAKE(add_mul_##P##_##BITS, FOUR(ALTERNATE(THREE_##BITS, "vadd" #P, "vmul" #P)))                  \
    MAKE(add_2mul_##P##_##BITS, FOUR(ONE_TO_TWO(THREE_##BITS, "vadd" #P, "vmul" #P)))              \
    MAKE(two_add_mul_##P##_##BITS, FOUR(ONE_TO_TWO(THREE_##BITS, "vmul" #P, "vadd" #P)))
LEGACY_KERNELS(sd) LEGACY_KERNELS(pd) LEGACY_KERNELS(ss) LEGACY_KERNELS(ps)
WIDE_KERNELS(pd, 256, "ymm", VEX_256) WIDE_KERNELS(ps, 256, "ymm", VEX_256)
WIDE_KERNELS(pd, 512, "zmm", EVEX_512) WIDE_KERNELS(ps, 512, "zmm", EVEX_512)
LEGACY(rsqrt_ss_128, FOUR(FOR_10(UNARY, "rsqrtss", "xmm") ADD_TO_4(TWO, "addss")))
LEGACY(rsqrt_ps_128, FOUR(FOR_10(UNARY, "rsqrtps", "xmm") ADD_TO_4(TWO, "addps")))
VEX_256(rsqrt_ps_256, FOUR(FOR_10(UNARY, "vrsqrtps", "ymm") ADD_TO_4(THREE_256, "vaddps")))
EVEX_512(rsqrt_ps_512, FOUR(FOR_10(UNARY, "vrsqrt14ps", "zmm") ADD_TO_4(THREE_512, "vaddps")))
VEX_128(rsqrt_sd_128, FOUR(FOR_10(SCALAR, "vrsqrt14sd", "xmm") ADD_TO_4(THREE_128, "vaddsd")))
VEX_128(rsqrt_pd_128, FOUR(FOR_10(UNARY, "vrsqrt14pd", "xmm") ADD_TO_4(THREE_128, "vaddpd")))
VEX_256(rsqrt_pd_256, FOUR(FOR_10(UNARY, "vrsqrt14pd", "ymm") ADD_TO_4(THREE_256, "vaddpd")))
EVEX_512(rsqrt_pd_512, FOUR(FOR_10(UNARY, "vrsqrt14pd", "zmm") ADD_TO_4(THREE_512, "vaddpd")))
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
#define RSQRT_ERROR (1.5 / 4096) // documented relative error of rsqrtss and rsqrtps
#define RSQRT14_ERROR (1.0 / 16384)
                                        const
    struct arithmetic_kernel ARITHMETIC_KERNELS[] = {
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
#endif

enum form kernel_form(enum kind kind) {
    return kind == SQRT || kind == RSQRT ? FROM_RISING : kind == MINMAX ? RUNNING_MAX : CHAINED;
}

int operations_per_loop(enum kind kind) {
    enum form form = kernel_form(kind);
    int registers = form == CHAINED ? 14 : form == FROM_RISING ? 10 : 12;
    return registers * (form == RUNNING_MAX ? 16 : BODY_REPEATS) * REGISTERS / BANK;
}

int kernel_lanes(const struct arithmetic_kernel *c) {
    return c->bits / (c->is_double ? 64 : 32);
}

int flops_per_operation(const struct arithmetic_kernel *c) {
    return kernel_lanes(c) * (c->kind == FMA ? 2 : 1);
}

void kernel_name(const struct arithmetic_kernel *c, char text[64]) {
    snprintf(text, 64, "%s %s %d bits", KIND_NAMES[c->kind], c->is_double ? "double" : "single",
             c->bits);
}
