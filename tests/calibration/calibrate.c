// Known work, to calibrate whatever counts FLOPs, bytes and instructions.
//
//     calibrate PART REPEATS
//
// runs each function of the part REPEATS times, with 10 rounds of its loop a time, inside
// phase_render. The functions are written in assembly, so that no compiler decides what is
// executed; what each of them does is added up by hand in expected.json. In a counting build
// (-DSTEPWISE_COUNT) the counts are printed as the driver does.
//
// The part `state` counts nothing: it ends with status 1 if a counter that was put into the code
// disturbs flags, registers or the red zone.
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef STEPWISE_COUNT
#include "counting/count.h"
#endif

enum { ROUNDS = 10, MOST = 6, BAD_INPUT = 2, NO_ISA = 3 };

static _Alignas(64) unsigned char buffer[1024];

// A function of this many rounds (rdi) on a buffer (rsi); what it returns is a fault if not 0.
typedef int kernel(long rounds, void *buffer);

// clang-format off: one step of a loop a line
#define DEFINE(name, body)                                                                         \
    kernel name;                                                                                   \
    __asm__(".text\n.p2align 4\n.globl " #name "\n.type " #name ", @function\n" #name \
            ":\n" body ".size " #name ", .-" #name "\n");
#define I(text) "\t" text "\n"
#define LOOP(body) "1:\n" body I("decq %rdi") I("jnz 1b")
#define RETURN I("xorl %eax, %eax") I("ret")
#define RETURN_AVX I("vzeroupper") RETURN

// s: sd or ss; more: what only one precision has.
#define SCALAR(s, more)                                                                            \
    LOOP(I("mov" s " (%rsi), %xmm0")                                                               \
         I("add" s " (%rsi), %xmm0") I("add" s " %xmm1, %xmm0") I("sub" s " %xmm1, %xmm0")         \
         I("mul" s " %xmm1, %xmm0") I("mul" s " %xmm1, %xmm0") I("mul" s " %xmm1, %xmm0")          \
         I("div" s " %xmm1, %xmm0") I("sqrt" s " (%rsi), %xmm2")                                   \
         I("min" s " %xmm1, %xmm0") I("max" s " %xmm1, %xmm0") I("max" s " %xmm2, %xmm0")          \
         I("ucomi" s " %xmm1, %xmm0") I("comi" s " %xmm1, %xmm0") I("cmplt" s " %xmm1, %xmm2")     \
         I("cvtt" s "2si %xmm0, %rax") I("cvtsi2" s "q %rax, %xmm3")                               \
         I("mov" s " %xmm0, 128(%rsi)") more)                                                      \
    RETURN
DEFINE(scalar_double, SCALAR("sd", ""))
DEFINE(scalar_single, SCALAR("ss", I("rcpss %xmm0, %xmm4") I("rsqrtss %xmm0, %xmm4")))

#define SSE(p, more)                                                                               \
    LOOP(I("mova" p " (%rsi), %xmm0")                                                              \
         I("add" p " (%rsi), %xmm0") I("sub" p " %xmm1, %xmm0")                                    \
         I("mul" p " %xmm1, %xmm0") I("mul" p " %xmm1, %xmm0")                                     \
         I("div" p " %xmm1, %xmm0") I("sqrt" p " (%rsi), %xmm2")                                   \
         I("min" p " %xmm1, %xmm0") I("max" p " %xmm1, %xmm0")                                     \
         I("hadd" p " %xmm1, %xmm0") I("addsub" p " %xmm1, %xmm0")                                 \
         I("cmple" p " %xmm1, %xmm2")                                                              \
         I("and" p " %xmm1, %xmm2") I("xor" p " %xmm1, %xmm2") I("unpckl" p " %xmm1, %xmm2")       \
         I("cvtdq2" p " %xmm3, %xmm3") I("mova" p " %xmm0, 128(%rsi)") more)                       \
    RETURN
DEFINE(sse_double, SSE("pd", ""))
DEFINE(sse_single, SSE("ps", I("rcpps %xmm0, %xmm4") I("rsqrtps %xmm0, %xmm4")))

#define AVX2(p, s, convert, more)                                                                  \
    LOOP(I("vmova" p " (%rsi), %ymm0")                                                             \
         I("vadd" p " (%rsi), %ymm0, %ymm0") I("vsub" p " %ymm1, %ymm0, %ymm0")                    \
         I("vmul" p " %ymm1, %ymm0, %ymm0")                                                        \
         I("vdiv" p " %ymm1, %ymm0, %ymm0") I("vsqrt" p " (%rsi), %ymm2")                          \
         I("vmin" p " %ymm1, %ymm0, %ymm0") I("vmax" p " %ymm1, %ymm0, %ymm0")                     \
         I("vhadd" p " %ymm1, %ymm0, %ymm0") I("vaddsub" p " %ymm1, %ymm0, %ymm0")                 \
         I("vfmadd132" p " %ymm1, %ymm2, %ymm3") I("vfmadd213" p " (%rsi), %ymm2, %ymm3")          \
         I("vfmadd231" p " %ymm1, %ymm2, %ymm3") I("vfmsub231" p " %ymm1, %ymm2, %ymm3")           \
         I("vfnmadd213" p " %ymm1, %ymm2, %ymm3") I("vfnmsub132" p " %ymm1, %ymm2, %ymm3")         \
         I("vfmaddsub231" p " %ymm1, %ymm2, %ymm3")                                                \
         I("vcmplt" p " %ymm1, %ymm0, %ymm4")                                                      \
         I("vblendv" p " %ymm4, %ymm1, %ymm0, %ymm5") I("vand" p " %ymm4, %ymm1, %ymm5")           \
         I("vround" p " $0, %ymm0, %ymm5") I(convert)                                              \
         I("vmaskmov" p " (%rsi), %ymm4, %ymm5") I("vmova" p " %ymm0, 128(%rsi)")                  \
         I("vfmadd231" s " %xmm1, %xmm2, %xmm6") I("vfmadd213" p " %xmm1, %xmm2, %xmm6") more)     \
    RETURN_AVX
DEFINE(avx2_double, AVX2("pd", "sd", "vcvtdq2pd %xmm7, %ymm7", ""))
DEFINE(avx2_single, AVX2("ps", "ss", "vcvtdq2ps %ymm7, %ymm7",
                         I("vrcpps %ymm0, %ymm7") I("vrsqrtps %ymm0, %ymm7")))

// k1 has lanes 0 and 2, k2 has lanes 0 to 7, k3 has none.
#define MASKS                                                                                      \
    I("movl $0x5, %eax") I("kmovw %eax, %k1") I("movl $0xff, %eax") I("kmovw %eax, %k2")           \
    I("kxorw %k3, %k3, %k3")
#define AVX512(p, lanes)                                                                           \
    MASKS                                                                                          \
    LOOP(I("vmova" p " (%rsi), %zmm0")                                                             \
         I("vadd" p " (%rsi), %zmm0, %zmm0") I("vadd" p " %zmm1, %zmm0, %zmm2{%k1}")               \
         I("vsub" p " %zmm1, %zmm0, %zmm2{%k1}{z}")                                                \
         I("vadd" p " {rn-sae}, %zmm0, %zmm1, %zmm2{%k2}")                                         \
         I("vmul" p " %zmm1, %zmm0, %zmm2{%k2}") I("vmul" p " %zmm1, %zmm0, %zmm2")                \
         I("vdiv" p " %zmm1, %zmm0, %zmm2{%k3}") I("vsqrt" p " (%rsi), %zmm3{%k1}")                \
         I("vmin" p " %zmm1, %zmm0, %zmm2{%k2}{z}") I("vmax" p " %zmm1, %zmm0, %zmm2")             \
         I("vrcp14" p " %zmm0, %zmm4") I("vrsqrt14" p " %zmm0, %zmm4{%k1}{z}")                     \
         I("vfmadd231" p " %zmm0, %zmm1, %zmm2{%k1}")                                              \
         I("vfnmadd213" p " (%rsi){1to" lanes "}, %zmm1, %zmm2")                                   \
         I("vfmsub132" p " %zmm0, %zmm1, %zmm2{%k3}{z}")                                           \
         I("vcmplt" p " %zmm0, %zmm1, %k4{%k1}") I("vcmplt" p " %zmm0, %zmm1, %k4")                \
         I("vmovu" p " (%rsi), %zmm5{%k1}{z}") I("vmovu" p " %zmm5, 128(%rsi){%k1}")               \
         I("vblendm" p " %zmm0, %zmm1, %zmm2{%k1}") I("vrndscale" p " $0, %zmm0, %zmm6{%k2}")      \
         I("kortestw %k4, %k4") I("vmova" p " %zmm0, 192(%rsi)"))                                  \
    RETURN_AVX
DEFINE(avx512_double, AVX512("pd", "8"))
DEFINE(avx512_single, AVX512("ps", "16"))

// The same masks on less than 512 bits: k2 has more lanes than there are.
#define VL(p, s, x)                                                                                \
    MASKS                                                                                          \
    LOOP(I("vadd" p " %" x "0, %" x "1, %" x "2{%k1}")                                             \
         I("vmul" p " %" x "0, %" x "1, %" x "2{%k2}{z}")                                          \
         I("vdiv" p " %" x "0, %" x "1, %" x "2{%k3}")                                             \
         I("vfmadd231" p " %" x "0, %" x "1, %" x "2{%k1}{z}")                                     \
         I("vfmadd213" p " (%rsi), %" x "1, %" x "2{%k2}")                                         \
         I("vrsqrt14" p " %" x "0, %" x "3{%k1}") I("vmax" p " %" x "0, %" x "1, %" x "2")         \
         I("vmovu" p " (%rsi), %" x "4{%k1}{z}") I("vmovu" p " %" x "4, 128(%rsi){%k2}")           \
         I("vadd" s " %xmm0, %xmm1, %xmm2{%k1}") I("vmul" s " %xmm0, %xmm1, %xmm2{%k3}")           \
         I("vfmadd213" s " %xmm0, %xmm1, %xmm2{%k2}{z}")                                           \
         I("vsqrt" s " %xmm0, %xmm1, %xmm2{%k1}"))                                                 \
    RETURN_AVX
DEFINE(vl_double_128, VL("pd", "sd", "xmm"))
DEFINE(vl_double_256, VL("pd", "sd", "ymm"))
DEFINE(vl_single_128, VL("ps", "ss", "xmm"))
DEFINE(vl_single_256, VL("ps", "ss", "ymm"))

DEFINE(x87_extended, LOOP(I("fldl (%rsi)") I("fadd %st(0), %st") I("fmul %st(0), %st") I("fsqrt")
                              I("fstpl 128(%rsi)")) RETURN)

// 37 bytes set; 5 quadwords copied; a byte found as the 12th of 37; none set.
DEFINE(string_bytes,
       I("movq %rdi, %r8") I("movq %rsi, %r9")
       "1:\n"
       I("movq %r9, %rdi") I("movl $37, %ecx") I("xorl %eax, %eax") I("rep stosb")
       I("movq %r9, %rsi") I("leaq 64(%r9), %rdi") I("movl $5, %ecx") I("rep movsq")
       I("movb $1, 11(%r9)")
       I("movq %r9, %rdi") I("movl $37, %ecx") I("movl $1, %eax") I("repne scasb")
       I("movq %r9, %rdi") I("xorl %ecx, %ecx") I("rep stosb")
       I("decq %r8") I("jnz 1b") RETURN)

// Its entry is the head of its loop. calls_inner is called three times a round and jumped to at the
// end, once by a jump that is never taken; calls_maybe jumps there when the round is odd.
DEFINE(calls_outer, LOOP(I("call calls_inner") I("call calls_inner") I("call calls_inner")
                             I("call calls_maybe")) I("testq %rsi, %rsi") I("jz calls_inner")
                        I("jmp calls_inner"))
DEFINE(calls_inner, I("movl %edi, %eax") I("andl $1, %eax") I("jz 2f") I("xorl %eax, %eax")
                        I("ret") "2:\n" I("xorl %eax, %eax") I("ret"))
DEFINE(calls_maybe, I("testb $1, %dil") I("jnz calls_inner") I("ret"))

// Flags, rax, rcx and the red zone, before and behind what the counters are put around.
// flags: as pushed; ah_al: the same as lahf and seto give them; rcx: 3 before, this behind.
#define STATE(flags, ah_al, rcx, middle)                                                           \
    I("leaq 256(%rsi), %rdi") I("xorl %r8d, %r8d") I("pushq $" flags) I("popfq")                   \
    I("movabsq $0x0123456789abcdef, %rax") I("movl $3, %ecx")                                      \
    I("movabsq $0x7edcba9876543210, %r10") I("movq %r10, -8(%rsp)")                                \
    I("movq %r10, -64(%rsp)") I("movq %r10, -128(%rsp)")                                           \
    I("jmp 2f") "2:\n" middle I("jmp 3f") "3:\n"                                                   \
    I("movq %rax, %r11") I("lahf") I("seto %al") I("movzwl %ax, %edx") I("xorl $" ah_al ", %edx")  \
    I("orq %rdx, %r8") I("xorq $" rcx ", %rcx") I("orq %rcx, %r8")                                 \
    I("movabsq $0x0123456789abcdef, %rdx")                                                         \
    I("xorq %rdx, %r11") I("orq %r11, %r8")                                                        \
    I("movabsq $0x7edcba9876543210, %rdx")                                                         \
    I("xorq -8(%rsp), %rdx") I("orq %rdx, %r8") I("xorq -8(%rsp), %rdx")                           \
    I("xorq -64(%rsp), %rdx") I("orq %rdx, %r8") I("xorq -64(%rsp), %rdx")                         \
    I("xorq -128(%rsp), %rdx") I("orq %rdx, %r8")                                                  \
    I("xorl %eax, %eax") I("testq %r8, %r8") I("setne %al") I("ret")
#define SET "0x8d5", "0xd701" // CF PF AF ZF SF OF
#define CLEAR "0", "0x0200"
#define STATE_OF(flags, rcx, middle) STATE_(flags, rcx, middle)
#define STATE_(...) STATE(__VA_ARGS__)
DEFINE(state_set, STATE_OF(SET, "3", ""))
DEFINE(state_clear, STATE_OF(CLEAR, "3", ""))
DEFINE(state_repeat_set, STATE_OF(SET, "0", I("rep stosb")))
DEFINE(state_repeat_clear, STATE_OF(CLEAR, "0", I("rep stosb")))
#define MASKED I("kxnorw %k1, %k1, %k1") I("vaddpd %zmm0, %zmm0, %zmm0{%k1}")
DEFINE(state_masked_set, STATE_OF(SET, "3", MASKED))
DEFINE(state_masked_clear, STATE_OF(CLEAR, "3", MASKED))

// clang-format on

static const struct part {
    const char *name;
    kernel *kernels[MOST];
} parts[] = {
    {"scalar", {scalar_double, scalar_single}},
    {"sse", {sse_double, sse_single}},
    {"avx2", {avx2_double, avx2_single}},
    {"avx512", {avx512_double, avx512_single}},
    {"avx512vl", {vl_double_128, vl_double_256, vl_single_128, vl_single_256}},
    {"x87", {x87_extended}},
    {"string", {string_bytes}},
    {"calls", {calls_outer}},
    {"state", {state_set, state_clear, state_repeat_set, state_repeat_clear}},
    {"state-avx512", {state_masked_set, state_masked_clear}},
    {"threads", {sse_double}}, // by one thread, and twice as often by a second one
};
enum { PARTS = sizeof parts / sizeof parts[0] };

static int repeat(const struct part *part, long repeats) {
    int faults = 0;
    for (int k = 0; k < MOST && part->kernels[k]; k++)
        for (long i = 0; i < repeats; i++)
            faults |= part->kernels[k](ROUNDS, buffer);
    return faults;
}

struct work {
    const struct part *part;
    long repeats;
    unsigned char buffer[256 + 63];
};

static void *second_thread(void *data) {
    struct work *work = data;
    void *aligned = (void *)(((size_t)work->buffer + 63) / 64 * 64);
    for (long i = 0; i < work->repeats; i++)
        work->part->kernels[0](ROUNDS, aligned);
    return NULL;
}

// The region that is counted, under the name of what is timed in a phase.
__attribute__((noinline)) int phase_render(const struct part *part, long repeats);
int phase_render(const struct part *part, long repeats) {
    struct work work = {part, 2 * repeats, {0}};
    pthread_t thread;
    bool two = strcmp(part->name, "threads") == 0;
    if (two && pthread_create(&thread, NULL, second_thread, &work) != 0)
        return 1;
    int faults = repeat(part, repeats);
    if (two && pthread_join(thread, NULL) != 0)
        return 1;
    return faults;
}

static bool lacks_isa(const char *name) {
    __builtin_cpu_init();
    if (strcmp(name, "avx2") == 0)
        return !__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma");
    if (strstr(name, "avx512"))
        return !__builtin_cpu_supports("avx512f") || !__builtin_cpu_supports("avx512vl") ||
               !__builtin_cpu_supports("avx512dq");
    return false;
}

int main(int argc, char **argv) {
    const struct part *part = NULL;
    for (size_t i = 0; argc == 3 && i < PARTS; i++)
        if (strcmp(argv[1], parts[i].name) == 0)
            part = &parts[i];
    char *end = NULL;
    long repeats = argc == 3 ? strtol(argv[2], &end, 10) : 0;
    if (!part || *end || repeats < 1 || repeats > 1000000) {
        fprintf(stderr, "calibrate: PART and REPEATS (1 to 1000000) are required; parts are");
        for (size_t i = 0; i < PARTS; i++)
            fprintf(stderr, " %s", parts[i].name);
        fprintf(stderr, "\n");
        return BAD_INPUT;
    }
    if (lacks_isa(part->name)) {
        fprintf(stderr, "calibrate: this CPU lacks what %s needs\n", part->name);
        return NO_ISA;
    }
#ifdef STEPWISE_COUNT
    count_begin();
#endif
    int faults = phase_render(part, repeats);
#ifdef STEPWISE_COUNT
    count_end();
    json_t *counts = count_result();
    if (!counts || json_dumpf(counts, stdout, 0) != 0 || puts("") == EOF)
        return BAD_INPUT;
    json_decref(counts);
#endif
    if (faults)
        fprintf(stderr, "calibrate: %s: flags, registers or red zone were not kept\n", part->name);
    return faults != 0;
}
