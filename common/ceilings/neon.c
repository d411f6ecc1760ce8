// The kernels of arm64 in assembly: see arithmetic.h and bandwidth.h. The assembler writes a line once for each
// register i of a list (.irp). P and T: what stands before and behind a register's number, as in v0.2d and d0.
#include "arithmetic.h"
#include "bandwidth.h"

#ifdef __aarch64__
#define WHOLE_BANK "0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15"
#define EVERY WHOLE_BANK ",16,17,18,19,20,21,22,23,24,25,26,27,28,29,30,31"
#define CHAINS "0,1,2,3,4,5,6,7,8,9,10,11,12,13,16,17,18,19,20,21,22,23,24,25,26,27,28,29"
#define EACH(LIST, TEXT) ".irp i," LIST "\n\t" TEXT ".endr\n\t"
#define EITHER(TEST, A, B) ".if " TEST "\n\t" A ".else\n\t" B ".endif\n\t"
#define CLOBBERED                                                                                  \
    "v0", "v1", "v2", "v3", "v4", "v5", "v6", "v7", "v8", "v9", "v10", "v11", "v12", "v13", "v14", \
        "v15", "v16", "v17", "v18", "v19", "v20", "v21", "v22", "v23", "v24", "v25", "v26", "v27", \
        "v28", "v29", "v30", "v31"
#define BEGIN EACH(EVERY, "ldr q\\i, [%[in], #\\i*64]\n\t") ".p2align 6\n1:\n\t"
#define END                                                                                        \
    "subs %[loops], %[loops], #1\n\tb.ne 1b\n\t" EACH(EVERY, "str q\\i, [%[out], #\\i*64]\n\t")

#define AT(P, T) P "\\i\\()" T
// x = x op register 14; x = x + register 14 · register 15
#define THREE(OP, P, T) OP " " AT(P, T) ", " AT(P, T) ", " P "14" T "\n\t"
#define FUSED_LANES(P, T) "fmla " AT(P, T) ", " P "14" T ", " P "15" T "\n\t"
#define FUSED_SCALAR(P, T) "fmadd " AT(P, T) ", " P "14, " P "15, " AT(P, T) "\n\t"
// x = max(x, register 12 of its bank)
#define MAXIMUM_WITH(K, P, T) "fmax " AT(P, T) ", " AT(P, T) ", " P K T "\n\t"
#define MAXIMUM(P, T)                                                                              \
    EACH("0,1,2,3,4,5,6,7,8,9,10,11,16,17,18,19,20,21,22,23,24,25,26,27",                          \
         EITHER("\\i & 16", MAXIMUM_WITH("28", P, T), MAXIMUM_WITH("12", P, T)))
// t = op(x), where x rises
#define UNARY(OP, P, T, LIST, X) EACH(LIST, OP " " AT(P, T) ", " P X T "\n\t")
#define RISING(OP, P, T)                                                                           \
    UNARY(OP, P, T, "0,4,8", "10")                                                                 \
    UNARY(OP, P, T, "1,5,9", "11")                                                                 \
    UNARY(OP, P, T, "2,6", "12")                                                                   \
    UNARY(OP, P, T, "3,7", "13")                                                                   \
    UNARY(OP, P, T, "16,20,24", "26")                                                              \
    UNARY(OP, P, T, "17,21,25", "27")                                                              \
    UNARY(OP, P, T, "18,22", "28")                                                                 \
    UNARY(OP, P, T, "19,23", "29") EACH("10,11,12,13,26,27,28,29", THREE("fadd", P, T))

#define FOUR(BODY) BODY BODY BODY BODY
#define KERNEL(NAME, BODY)                                                                         \
    static __attribute__((noinline)) void NAME(long loops, const void *in, void *out) {            \
        __asm__ volatile(BEGIN BODY END                                                            \
                         : [loops] "+&r"(loops)                                                    \
                         : [in] "r"(in), [out] "r"(out)                                            \
                         : "memory", "cc", CLOBBERED);                                             \
    }
#define ONE(NAME, OP, P, T) KERNEL(NAME, FOUR(EACH(CHAINS, THREE(OP, P, T))))
#define MIX(NAME, TEST, A, B, P, T)                                                                \
    KERNEL(NAME, FOUR(EACH(CHAINS, EITHER(TEST, THREE(A, P, T), THREE(B, P, T)))))
#define KERNELS(N, P, T, FUSED)                                                                    \
    KERNEL(fma_##N, FOUR(EACH(CHAINS, FUSED(P, T))))                                               \
    ONE(add_##N, "fadd", P, T)                                                                     \
    ONE(mul_##N, "fmul", P, T)                                                                     \
    ONE(div_##N, "fdiv", P, T)                                                                     \
    KERNEL(minmax_##N, FOUR(FOUR(MAXIMUM(P, T))) EACH("12,28", THREE("fadd", P, T)))               \
    KERNEL(sqrt_##N, FOUR(RISING("fsqrt", P, T)))                                                  \
    KERNEL(rsqrt_##N, FOUR(RISING("frsqrte", P, T)))                                               \
    MIX(add_mul_##N, "\\i & 1", "fmul", "fadd", P, T)                                              \
    MIX(add_2mul_##N, "(\\i & 15) %% 3", "fmul", "fadd", P, T)                                     \
    MIX(two_add_mul_##N, "(\\i & 15) %% 3", "fadd", "fmul", P, T)
KERNELS(d, "d", "", FUSED_SCALAR)
KERNELS(v2d, "v", ".2d", FUSED_LANES)
KERNELS(s, "s", "", FUSED_SCALAR)
KERNELS(v4s, "v", ".4s", FUSED_LANES)

// The architecture defines frsqrte's result: 1/305 is its largest error (DDI 0487, FPRSqrtEstimate).
#define TEN(N, DOUBLE, BITS)                                                                       \
    {FMA, DOUBLE, BITS, fma_##N, NULL, 0}, {ADD, DOUBLE, BITS, add_##N, NULL, 0},                  \
        {MUL, DOUBLE, BITS, mul_##N, NULL, 0}, {MINMAX, DOUBLE, BITS, minmax_##N, NULL, 0},        \
        {DIV, DOUBLE, BITS, div_##N, NULL, 0}, {SQRT, DOUBLE, BITS, sqrt_##N, NULL, 0},            \
        {RSQRT, DOUBLE, BITS, rsqrt_##N, NULL, 1.0 / 305},                                         \
        {ADD_MUL, DOUBLE, BITS, add_mul_##N, NULL, 0},                                             \
        {ADD_2MUL, DOUBLE, BITS, add_2mul_##N, NULL, 0},                                           \
        {TWO_ADD_MUL, DOUBLE, BITS, two_add_mul_##N, NULL, 0}
const struct arithmetic_kernel ARITHMETIC_KERNELS[] = {TEN(d, true, 64), TEN(v2d, true, 128),
                                                       TEN(s, false, 32), TEN(v4s, false, 128)};

// --- Bandwidth. p: where the block begins; d: where a copy of it begins.
#define TRANSFER_KERNEL(NAME, BYTES, BODY)                                                         \
    static __attribute__((noinline)) void NAME(long loops, struct window *w, const void *in,       \
                                               void *out) {                                        \
        char *p, *d;                                                                               \
        size_t offset = w->offset;                                                                 \
        __asm__ volatile(                                                                          \
            BEGIN "add %[p], %[base], %[offset]\n\t"                                               \
                  "add %[d], %[p], %[copy_distance]\n\t"                                           \
                  "add %[offset], %[offset], #16*" BYTES "\n\t"                                    \
                  "and %[offset], %[offset], %[mask]\n\t" BODY END                                 \
            : [loops] "+&r"(loops), [offset] "+&r"(offset), [p] "=&r"(p), [d] "=&r"(d)             \
            : [in] "r"(in), [out] "r"(out), [base] "r"(w->base),                                   \
              [copy_distance] "r"(w->copy_distance), [mask] "r"(w->mask)                           \
            : "memory", "cc", CLOBBERED);                                                          \
        w->offset = offset;                                                                        \
    }
#define SINGLE(OP, P, BASE, BYTES) OP " " P "\\i, [%[" BASE "], #\\i*" BYTES "]\n\t"
#define SINGLES(BITS, P, BYTES)                                                                    \
    TRANSFER_KERNEL(load_##BITS, BYTES, EACH(WHOLE_BANK, SINGLE("ldr", P, "p", BYTES)))            \
    TRANSFER_KERNEL(store_##BITS, BYTES, EACH(WHOLE_BANK, SINGLE("str", P, "p", BYTES)))           \
    TRANSFER_KERNEL(copy_##BITS, BYTES,                                                            \
                    EACH(WHOLE_BANK, SINGLE("ldr", P, "p", BYTES) SINGLE("str", P, "d", BYTES)))
SINGLES(64, "d", "8")
SINGLES(128, "q", "16")
#define PAIR(OP, BASE, A, B) OP " q" #A ", q" #B ", [%[" BASE "], #" #A "*16]\n\t"
#define LOAD_PAIR(A, B) PAIR("ldp", "p", A, B)
#define STORE_PAIR(A, B) PAIR("stp", "p", A, B)
#define COPY_PAIR(A, B) PAIR("ldp", "p", A, B) PAIR("stp", "d", A, B)
#define PAIRS(M) M(0, 1) M(2, 3) M(4, 5) M(6, 7) M(8, 9) M(10, 11) M(12, 13) M(14, 15)
TRANSFER_KERNEL(load_256, "16", PAIRS(LOAD_PAIR))
TRANSFER_KERNEL(store_256, "16", PAIRS(STORE_PAIR))
TRANSFER_KERNEL(copy_256, "16", PAIRS(COPY_PAIR))

#define LOAD_STORE_COPY(BITS)                                                                      \
    {LOAD, BITS, load_##BITS, NULL}, {STORE, BITS, store_##BITS, NULL}, {                          \
        COPY, BITS, copy_##BITS, NULL                                                              \
    }
const struct transfer_kernel TRANSFER_KERNELS[] = {LOAD_STORE_COPY(64), LOAD_STORE_COPY(128),
                                                   LOAD_STORE_COPY(256)};
#endif
