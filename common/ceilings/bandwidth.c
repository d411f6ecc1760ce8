#include "bandwidth.h"

#include <stdio.h>
#include <string.h>

#include "registers.h"

const char *const MOTION_NAMES[MOTIONS] = {"load", "store", "copy"};

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

#define MOVING(BITS, NEEDS)                                                                        \
    {LOAD, BITS, load_##BITS, NEEDS}, {STORE, BITS, store_##BITS, NEEDS}, {                        \
        COPY, BITS, copy_##BITS, NEEDS                                                             \
    }
const struct moving MOVINGS[] = {MOVING(64, NULL), MOVING(128, NULL), MOVING(256, "avx"),
                                 MOVING(512, "avx512f")};
int loop_bytes(const struct moving *m) {
    return BLOCK * m->bits / 8 * (m->motion == COPY ? 2 : 1);
}

uint64_t word_at(size_t index) {
    return 0x9e3779b97f4a7c15u * (index + 1);
}

static bool complain_of(const struct moving *m, const char *what, size_t at, bool quiet) {
    if (!quiet)
        fprintf(stderr,
                "ceilings: %s %d bits: wrong %s at byte %zu: the kernel did not do its work\n",
                MOTION_NAMES[m->motion], m->bits, what, at);
    return false;
}

bool moves_rightly(const struct moving *m, long loops, long pretend, bool quiet) {
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
