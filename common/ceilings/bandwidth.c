// The bandwidth kernels of x86-64 in assembly, and the check of all. See bandwidth.h.
#include "bandwidth.h"

#include <stdio.h>
#include <string.h>

#include "registers.h"

const char *const TRANSFER_NAMES[TRANSFER_KINDS] = {"load", "store", "copy"};

#ifdef __x86_64__
#define LOAD_AT(MOV, R, BYTES, I) MOV " " #I "*" #BYTES "(%[p]), %%" R #I "\n\t"
#define STORE_AT(MOV, R, BYTES, I) MOV " %%" R #I ", " #I "*" #BYTES "(%[p])\n\t"
#define STORE_COPY(MOV, R, BYTES, I) MOV " %%" R #I ", " #I "*" #BYTES "(%[p],%[copy_distance])\n\t"
#define COPY_AT(MOV, R, BYTES, I) LOAD_AT(MOV, R, BYTES, I) STORE_COPY(MOV, R, BYTES, I)
// clang-format off
#define ALL(M, MOV, R, BYTES)                                                   \
    M(MOV, R, BYTES, 0) M(MOV, R, BYTES, 1) M(MOV, R, BYTES, 2)                 \
    M(MOV, R, BYTES, 3) M(MOV, R, BYTES, 4) M(MOV, R, BYTES, 5)                 \
    M(MOV, R, BYTES, 6) M(MOV, R, BYTES, 7) M(MOV, R, BYTES, 8)                 \
    M(MOV, R, BYTES, 9) M(MOV, R, BYTES, 10) M(MOV, R, BYTES, 11)               \
    M(MOV, R, BYTES, 12) M(MOV, R, BYTES, 13) M(MOV, R, BYTES, 14)              \
    M(MOV, R, BYTES, 15)
// clang-format on
#define TRANSFER_KERNEL(NAME, WIDTH, WHOLE, END, BYTES, BODY)                                      \
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
            : [in] "r"(in), [out] "r"(out), [base] "r"(w->base),                                   \
              [copy_distance] "r"(w->copy_distance), [mask] "r"(w->mask)                           \
            : "memory", "cc", CLOBBERED);                                                          \
        w->offset = offset;                                                                        \
    }
#define LOAD_STORE_COPY(BITS, WIDTH, WHOLE, END, MOV, R, BYTES)                                    \
    TRANSFER_KERNEL(load_##BITS, WIDTH, WHOLE, END, BYTES, ALL(LOAD_AT, MOV, R, BYTES))            \
    TRANSFER_KERNEL(store_##BITS, WIDTH, WHOLE, END, BYTES, ALL(STORE_AT, MOV, R, BYTES))          \
    TRANSFER_KERNEL(copy_##BITS, WIDTH, WHOLE, END, BYTES, ALL(COPY_AT, MOV, R, BYTES))
LOAD_STORE_COPY(64, 128, "movups", "", "movsd", "xmm", 8)
LOAD_STORE_COPY(128, 128, "movups", "", "movups", "xmm", 16)
LOAD_STORE_COPY(256, 256, "vmovups", "vzeroupper", "vmovups", "ymm", 32)
LOAD_STORE_COPY(512, 512, "vmovups", "vzeroupper", "vmovups", "zmm", 64)

#define TRANSFER(BITS, NEEDS)                                                                      \
    {LOAD, BITS, load_##BITS, NEEDS}, {STORE, BITS, store_##BITS, NEEDS}, {                        \
        COPY, BITS, copy_##BITS, NEEDS                                                             \
    }
const struct transfer_kernel TRANSFER_KERNELS[] = {TRANSFER(64, NULL), TRANSFER(128, NULL),
                                                   TRANSFER(256, "avx"), TRANSFER(512, "avx512f")};
#endif

size_t register_bytes(const struct transfer_kernel *m) {
    return (size_t)(m->bits < WIDEST ? m->bits : WIDEST) / 8;
}

int bytes_per_loop(const struct transfer_kernel *m) {
    return BLOCK * (int)register_bytes(m) * (m->kind == COPY ? 2 : 1);
}

uint64_t test_word(size_t index) {
    return 0x9e3779b97f4a7c15u * (index + 1);
}

static bool report_mismatch(const struct transfer_kernel *m, const char *what, size_t at,
                            bool quiet) {
    if (!quiet)
        fprintf(stderr,
                "ceilings: %s %d bits: wrong %s at byte %zu: the kernel did not do its work\n",
                TRANSFER_NAMES[m->kind], m->bits, what, at);
    return false;
}

bool transfer_is_correct(const struct transfer_kernel *m, long loops, long expected_blocks,
                         bool quiet) {
    enum { WINDOW = 4096, WORDS = WINDOW / 8 };
    _Alignas(64) static uint64_t memory[2 * WORDS], wanted[2 * WORDS];
    _Alignas(64) static union {
        uint64_t words[REGISTERS][SLOT / 8];
    } in, out, last;
    size_t bytes = register_bytes(m);
    for (size_t i = 0; i < 2 * WORDS; i++)
        wanted[i] = memory[i] = test_word(i);
    for (size_t i = 0; i < REGISTERS * SLOT / 8; i++)
        last.words[i / 8][i % 8] = in.words[i / 8][i % 8] = test_word(i + 1000000);
    struct window w = {(char *)memory, WINDOW, WINDOW - 1, 0};
    m->run(loops, &w, &in, &out);
    for (long block = 0; block < expected_blocks; block++)
        for (size_t i = 0; i < BLOCK; i++) {
            size_t at = ((size_t)block * BLOCK + i) * bytes % WINDOW;
            if (m->kind != STORE)
                memcpy(last.words[i], (char *)wanted + at, bytes);
            if (m->kind != LOAD)
                memcpy((char *)wanted + at + (m->kind == COPY ? WINDOW : 0), last.words[i], bytes);
        }
    for (size_t i = 0; i < REGISTERS; i++)
        if (memcmp(out.words[i], last.words[i], bytes) != 0)
            return report_mismatch(m, "register", i, quiet);
    for (size_t i = 0; i < 2 * WORDS; i++)
        if (memory[i] != wanted[i])
            return report_mismatch(m, "memory", 8 * i, quiet);
    if (w.offset != (size_t)expected_blocks * BLOCK * bytes % WINDOW)
        return report_mismatch(m, "offset", w.offset, quiet);
    return true;
}
