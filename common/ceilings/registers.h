// The vector registers, 16 of x86-64 and 32 of arm64. Every kernel loads them from memory at its start and
// stores them at its end, one per slot of 64 bytes. Here are their type in C, and the assembly that loads and
// stores those of x86-64.
#pragma once

#include <stdbool.h>

#ifdef __aarch64__
enum { REGISTERS = 32 };
#else
enum { REGISTERS = 16 };
#endif
// BANK: arm64's second 16 registers do what the first do, since cores with four units of a latency of four
// cycles need 16 operations under way. SLOT: bytes of the widest register.
enum { BANK = 16, SLOT = 64 };

// The registers as lanes of either precision.
union registers {
    double d[REGISTERS][SLOT / 8];
    float f[REGISTERS][SLOT / 4];
};

// Lane i of register `at`.
static inline double lane(const union registers *r, bool is_double, int at, int i) {
    return is_double ? r->d[at][i] : (double)r->f[at][i];
}

static inline void set_lane(union registers *r, bool is_double, int at, int i, double value) {
    if (is_double)
        r->d[at][i] = value;
    else
        r->f[at][i] = (float)value;
}

#ifdef __x86_64__
// --- In assembly. M(OP, I) is the text for register I.

// clang-format off
#define RUN12(M, OP)                                                                               \
    M(OP, 0) M(OP, 1) M(OP, 2) M(OP, 3) M(OP, 4) M(OP, 5)                                          \
    M(OP, 6) M(OP, 7) M(OP, 8) M(OP, 9) M(OP, 10) M(OP, 11)
#define RUN14(M, OP) RUN12(M, OP) M(OP, 12) M(OP, 13)
#define RUN16(M, OP) RUN14(M, OP) M(OP, 14) M(OP, 15)
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
#endif
