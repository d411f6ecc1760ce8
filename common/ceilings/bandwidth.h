// Bandwidth kernels: loads, stores and copies through a window of memory.
//
// A kernel executes `loops` blocks of 16 registers each. Blocks follow each other through the window,
// from `offset` to its end and again from its start. Masking the offset avoids an inner loop, whose
// end would be mispredicted. The kernel updates `offset`, and loads and stores the 16 registers as
// in arithmetic.h.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum transfer_kind { LOAD, STORE, COPY, TRANSFER_KINDS };
extern const char *const TRANSFER_NAMES[TRANSFER_KINDS];

struct window {
    char *base;
    ptrdiff_t copy_distance; // bytes from the source of a copy to its destination
    size_t mask, offset;     // mask: size of the window − 1; the size is a power of two
};

struct transfer_kernel {
    enum transfer_kind kind;
    int bits; // of an instruction; on arm64 256: a pair of registers of 128 bits
    void (*run)(long loops, struct window *w, const void *in, void *out);
    const char *needs;
};
#ifdef __aarch64__
enum { TRANSFER_KERNEL_COUNT = 9, WIDEST = 128, BLOCK = 16 };
#else
enum { TRANSFER_KERNEL_COUNT = 12, WIDEST = 512, BLOCK = 16 }; // WIDEST: bits of a register
#endif
extern const struct transfer_kernel TRANSFER_KERNELS[TRANSFER_KERNEL_COUNT];

// Bytes of a register that a block reads or writes.
size_t register_bytes(const struct transfer_kernel *m);
// Bytes that a block reads and writes; a copy counts both.
int bytes_per_loop(const struct transfer_kernel *m);

// Contents of memory in the tests: all words differ, so that a wrong address is noticed.
uint64_t test_word(size_t index);

// Runs `loops` blocks in a small window of known contents and compares every byte of memory and every
// register with those after `expected_blocks` blocks. Returns whether all agree. Prints the first
// difference on standard error, unless `quiet`.
bool transfer_is_correct(const struct transfer_kernel *m, long loops, long expected_blocks,
                         bool quiet);
