#include "measure.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>

#include "expected.h"
#include "timing/timer.h"

enum { ROUNDS = 5 };

static const double SAMPLE_SECONDS =
    60e-6; // far below a time slice: the best one was not interrupted

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
    double flops = (double)p->loops * per_loop(c->kind) * flops_of(c);
    sample(&p->samples, clocks, compute_once, &one, true, flops, count);
    return work_done(c, &one.out, &p->wanted, false);
}

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

static size_t larger(size_t a, size_t b) {
    return a > b ? a : b;
}

// Huge pages where the kernel gives them: what is measured are caches, not the TLB. The window of
// memory begins behind that of L3, whose lines are still in the cache: that far behind is returned,
// 0 without memory.
static size_t take_memory(struct ceilings *all) {
    const struct place *places = all->places;
    size_t largest = 0;
    for (int level = 0; level < LEVELS; level++)
        largest = larger(largest, places[level].working_set);
    size_t huge = (size_t)2 << 20, front = (places[L3].working_set + 2 * huge) / huge * huge;
    size_t room = (front + largest + 3 * huge) / huge * huge;
    all->memory = aligned_alloc(huge, room);
    if (!all->memory) {
        fprintf(stderr, "ceilings: out of memory: %zu MiB are needed\n", room >> 20);
        return 0;
    }
    madvise(all->memory, room, MADV_HUGEPAGE);
    for (size_t i = 0; i < room / 8; i++)
        ((uint64_t *)(void *)all->memory)[i] = word_at(i);
    return front;
}

// A copy's two halves make up the working set, 2 KiB + 64 off the same place in a page: a load that
// seems to depend on a store of another page would wait for it (4 KiB aliasing).
static struct transfer transfer_of(const struct moving *m, size_t set, char *base) {
    size_t window = m->motion == COPY ? set / 2 : set;
    return (struct transfer){.moving = m,
                             .window = {base, (ptrdiff_t)window + 2048 + 64, window - 1, 0}};
}

enum status ceilings_prepare(struct ceilings *all) {
    all->clocks = (struct clocks){timer_tsc_hz(50), timer_overhead_cycles()};
    find_places(all->places);
    size_t front = take_memory(all);
    if (!front)
        return OUT_OF_MEMORY;
    for (int k = 0; k < COMPUTES; k++)
        if (has(COMPUTE[k].needs))
            plan(&COMPUTE[k], &all->computing[k], &all->clocks);
    for (int level = 0; level < LEVELS; level++)
        for (int k = 0; k < KINDS_OF_MOVING; k++) {
            size_t set = all->places[level].working_set;
            if (!set || !has(MOVINGS[k].needs))
                continue;
            all->transfers[level][k] =
                transfer_of(&MOVINGS[k], set, level == MEMORY ? all->memory + front : all->memory);
            if (!moves_rightly(&MOVINGS[k], 130, 130, false))
                return WRONG_WORK;
        }
    return OK;
}

// In rounds, so that a neighbour who is busy for a second spoils no ceiling's every sample.
enum status ceilings_measure(struct ceilings *all, int samples) {
    for (int round = 0; round < ROUNDS; round++) {
        int count = samples * (round + 1) / ROUNDS - samples * round / ROUNDS;
        for (int k = 0; k < COMPUTES; k++)
            if (has(COMPUTE[k].needs) &&
                !measure_compute(&COMPUTE[k], &all->computing[k], &all->clocks, count))
                return WRONG_WORK;
        for (int level = 0; level < LEVELS; level++)
            for (int k = 0; k < KINDS_OF_MOVING; k++)
                if (all->places[level].working_set && has(MOVINGS[k].needs))
                    measure_transfer((enum level)level, &all->transfers[level][k], &all->position,
                                     &all->clocks, count);
    }
    return OK;
}
