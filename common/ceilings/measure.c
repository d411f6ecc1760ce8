// See measure.h.
#include "measure.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>

#include "reference.h"
#include "timing/timer.h"

enum { ROUNDS = 5 };

// Far below a time slice, so that most samples are not interrupted.
static const double SAMPLE_SECONDS = 60e-6;

// Chooses the loops of a sample and computes the registers after them.
static void choose_loops(const struct arithmetic_kernel *c, struct arithmetic_run *p,
                         const struct clocks *clocks) {
    enum { TRIAL = 50, MAX_LOOPS = 10000 }; // MAX_LOOPS: keeps the operands near their start
    union registers out;
    initial_registers(c, &p->in);
    uint64_t fastest = UINT64_MAX;
    for (int i = 0; i < 5; i++) {
        uint64_t begin = timer_tsc_begin();
        c->run(TRIAL, &p->in, &out);
        uint64_t ticks = timer_tsc_end() - begin;
        fastest = ticks < fastest ? ticks : fastest;
    }
    double loops = TRIAL * SAMPLE_SECONDS / ticks_to_seconds(clocks, fastest);
    p->loops = loops < TRIAL ? TRIAL : loops > MAX_LOOPS ? MAX_LOOPS : (long)loops;
    reference_result(c, p->loops, &p->in, &p->wanted);
}

struct arithmetic_sample {
    const struct arithmetic_kernel *kernel;
    struct arithmetic_run *run;
    union registers out;
    bool wrong;
};

static void run_arithmetic(void *what) {
    struct arithmetic_sample *c = what;
    c->kernel->run(c->run->loops, &c->run->in, &c->out);
}

static bool measure_arithmetic(const struct arithmetic_kernel *c, struct arithmetic_run *p,
                               const struct clocks *clocks, int count) {
    struct arithmetic_sample one = {.kernel = c, .run = p};
    for (uint64_t begin = timer_ns(); timer_ns() - begin < 3000000;)
        run_arithmetic(&one);
    // All samples do the same, so that checking the last one's registers is enough.
    double flops = (double)p->loops * operations_per_loop(c->kind) * flops_per_operation(c);
    take_samples(&p->samples, clocks, run_arithmetic, &one, true, flops, count);
    return matches_reference(c, &one.out, &p->wanted, false);
}

static void run_transfer(void *what) {
    static _Alignas(64) union registers in, out;
    struct transfer_run *t = what;
    t->kernel->run(t->loops, &t->window, &in, &out);
}

// A sample transfers 512 KiB in L1 and L2, otherwise 4 MiB; copies read and write as much. In memory
// each sample continues where the last one of any kernel stopped (`position`). No cache line is used
// again before the whole working set has passed.
static void measure_transfer(enum level level, struct transfer_run *t, size_t *position,
                             const struct clocks *clocks, int count) {
    const struct transfer_kernel *m = t->kernel;
    size_t per_block = BLOCK * register_bytes(m);
    if (level == MEMORY) {
        t->window.offset = *position & t->window.mask;
    } else {
        t->loops = (long)(2 * (t->window.mask + 1) / per_block);
        run_transfer(t);
    }
    t->loops = (long)((level <= L2 ? (size_t)512 << 10 : (size_t)4 << 20) / per_block);
    run_transfer(t);
    double moved = (double)t->loops * bytes_per_loop(m);
    take_samples(&t->samples, clocks, run_transfer, t, level != MEMORY, moved, count);
    if (level == MEMORY)
        *position += (size_t)(count + 1) * (size_t)t->loops * per_block;
}

static size_t larger(size_t a, size_t b) {
    return a > b ? a : b;
}

// Allocates the memory of all working sets, in huge pages if possible, so that caches are measured and
// not the TLB. Returns the offset of the memory window, 0 if memory is short. It lies behind the L3
// window, whose lines are still in the cache.
static size_t allocate_memory(struct ceilings *all) {
    const struct working_set *working_sets = all->working_sets;
    size_t largest = 0;
    for (int level = 0; level < LEVELS; level++)
        largest = larger(largest, working_sets[level].bytes);
    size_t huge = (size_t)2 << 20, front = (working_sets[L3].bytes + 2 * huge) / huge * huge;
    size_t room = (front + largest + 3 * huge) / huge * huge;
    all->memory = aligned_alloc(huge, room);
    if (!all->memory) {
        fprintf(stderr, "ceilings: out of memory: %zu MiB are needed\n", room >> 20);
        return 0;
    }
    madvise(all->memory, room, MADV_HUGEPAGE);
    for (size_t i = 0; i < room / 8; i++)
        ((uint64_t *)(void *)all->memory)[i] = test_word(i);
    return front;
}

// A copy's source and destination together fill the working set. The destination is shifted by
// 2 KiB + 64 within its page: loads that agree with an earlier store in the low 12 address bits
// would wait for it (4 KiB aliasing).
static struct transfer_run make_transfer_run(const struct transfer_kernel *m, size_t set,
                                             char *base) {
    size_t window = m->kind == COPY ? set / 2 : set;
    return (struct transfer_run){.kernel = m,
                                 .window = {base, (ptrdiff_t)window + 2048 + 64, window - 1, 0}};
}

enum status ceilings_prepare(struct ceilings *all) {
    all->clocks = (struct clocks){timer_tsc_hz(50), timer_overhead_cycles()};
    choose_working_sets(all->working_sets);
    size_t front = allocate_memory(all);
    if (!front)
        return OUT_OF_MEMORY;
    for (int k = 0; k < ARITHMETIC_KERNEL_COUNT; k++)
        if (cpu_supports(ARITHMETIC_KERNELS[k].needs))
            choose_loops(&ARITHMETIC_KERNELS[k], &all->arithmetic_runs[k], &all->clocks);
    for (int level = 0; level < LEVELS; level++)
        for (int k = 0; k < TRANSFER_KERNEL_COUNT; k++) {
            size_t set = all->working_sets[level].bytes;
            if (!set || !cpu_supports(TRANSFER_KERNELS[k].needs))
                continue;
            all->transfer_runs[level][k] = make_transfer_run(
                &TRANSFER_KERNELS[k], set, level == MEMORY ? all->memory + front : all->memory);
            if (!transfer_is_correct(&TRANSFER_KERNELS[k], 130, 130, false))
                return WRONG_WORK;
        }
    return OK;
}

// Rounds spread each kernel's samples, so that a neighbour who is busy for a second cannot disturb all
// samples of one ceiling.
enum status ceilings_measure(struct ceilings *all, int samples) {
    for (int round = 0; round < ROUNDS; round++) {
        int count = samples * (round + 1) / ROUNDS - samples * round / ROUNDS;
        for (int k = 0; k < ARITHMETIC_KERNEL_COUNT; k++)
            if (cpu_supports(ARITHMETIC_KERNELS[k].needs) &&
                !measure_arithmetic(&ARITHMETIC_KERNELS[k], &all->arithmetic_runs[k], &all->clocks,
                                    count))
                return WRONG_WORK;
        for (int level = 0; level < LEVELS; level++)
            for (int k = 0; k < TRANSFER_KERNEL_COUNT; k++)
                if (all->working_sets[level].bytes && cpu_supports(TRANSFER_KERNELS[k].needs))
                    measure_transfer((enum level)level, &all->transfer_runs[level][k],
                                     &all->position, &all->clocks, count);
    }
    return OK;
}
