// Time per element: streams over arrays that stay in the L1 cache (throughput), and chains in which
// each call waits for the last one's result (latency; the chain of "link" is what the waiting
// itself costs). Rounds in which every entry comes once, in random order.
#include <stdio.h>
#include <stdlib.h>

#include "bench.h"
#include "timing/timer.h"

enum { ELEMENTS = 1024, NS = 60000 }; // NS: least length of a sample

struct plan {
    uint64_t calls, links; // repetitions of a stream and of a chain in one sample
    double *stream, *chain;
};

struct arrays { // doubles, or floats in the first half
    double a[ELEMENTS], b[ELEMENTS], out[ELEMENTS];
    double zero[8];
};

static void fill(const struct runnable *one, struct arrays *at) {
    const struct target *target = target_of(one->entry->function);
    struct span any = {0.001, 10, false};
    struct random random = {1};
    float *a = (float *)(void *)at->a, *b = (float *)(void *)at->b;
    for (size_t i = 0; i < ELEMENTS; i++) {
        double x = sample(target ? &target->timed[0] : &any, i, ELEMENTS, false, true, &random);
        double y = target && target->arguments == 2 ? sample(&target->timed[1], i * 389 % ELEMENTS,
                                                             ELEMENTS, false, true, &random)
                                                    : 0;
        size_t to = i * 701 % ELEMENTS; // branches find no order
        if (one->of->is_double)
            at->a[to] = x, at->b[to] = y;
        else
            a[to] = (float)x, b[to] = (float)y;
    }
}

static size_t lanes(const struct runnable *one) {
    return (size_t)one->of->bits / (one->of->is_double ? 64 : 32);
}

// ns of `repeat` runs over the arrays
static double run(const struct runnable *one, struct arrays *at, uint64_t repeat, bool chain,
                  double ns_per_tick) {
    uint64_t begin = timer_tsc_begin();
    for (uint64_t i = 0; i < repeat; i++)
        if (chain)
            one->entry->chain(one->external, ELEMENTS / lanes(one), at->a, at->b, at->zero,
                              at->out);
        else
            one->entry->stream(one->external, ELEMENTS, at->a, at->b, at->out);
    return (double)(timer_tsc_end() - begin) * ns_per_tick;
}

static uint64_t repetitions(const struct runnable *one, struct arrays *at, bool chain,
                            double ns_per_tick) {
    uint64_t repeat = 1;
    while (run(one, at, repeat, chain, ns_per_tick) < NS)
        repeat *= 2;
    return repeat;
}

static void shuffle(size_t *order, size_t count, struct random *random) {
    for (size_t i = count; i > 1; i--) {
        size_t k = (size_t)(random_unit(random) * (double)i), keep = order[i - 1];
        order[i - 1] = order[k];
        order[k] = keep;
    }
}

static void print_list(const char *name, const double *values, int count) {
    printf("\"%s\": [", name);
    for (int i = 0; i < count; i++)
        printf("%s%.6g", i ? ", " : "", values[i]);
    printf("]");
}

static bool measure(const struct runnable *all, size_t count, const struct settings *settings,
                    struct plan *plans, size_t *order, struct arrays *at, double *clocks) {
    double tsc_hz = timer_tsc_hz(20), ns_per_tick = 1e9 / tsc_hz;
    struct random random = {settings->seed};
    for (size_t k = 0; k < count; k++) {
        order[k] = k;
        if (all[k].missing)
            continue;
        plans[k].stream = calloc((size_t)settings->rounds, sizeof(double));
        plans[k].chain = calloc((size_t)settings->rounds, sizeof(double));
        if (!plans[k].stream || !plans[k].chain)
            return false;
        fill(&all[k], at);
        plans[k].calls = repetitions(&all[k], at, false, ns_per_tick);
        plans[k].links = repetitions(&all[k], at, true, ns_per_tick);
    }
    for (int round = 0; round < settings->rounds; round++) {
        shuffle(order, count, &random);
        for (size_t i = 0; i < count; i++) {
            const struct runnable *one = &all[order[i]];
            struct plan *plan = &plans[order[i]];
            if (one->missing)
                continue;
            fill(one, at);
            run(one, at, 1, false, ns_per_tick); // into the cache
            plan->stream[round] =
                run(one, at, plan->calls, false, ns_per_tick) / (double)(plan->calls * ELEMENTS);
            plan->chain[round] = run(one, at, plan->links, true, ns_per_tick) /
                                 (double)(plan->links * (ELEMENTS / lanes(one)));
        }
        for (int w = 0; w < 4; w++) // scalar, 128, 256, 512
            clocks[w * settings->rounds + round] =
                w ? timer_core_hz_under_load(tsc_hz, 3, 64 << w) : timer_core_hz(tsc_hz, 3);
    }
    return true;
}

bool print_times(const struct runnable *all, size_t count, const struct settings *settings) {
    struct plan *plans = calloc(count, sizeof *plans);
    size_t *order = calloc(count, sizeof *order);
    double *clocks = calloc((size_t)settings->rounds * 4, sizeof *clocks);
    struct arrays *at = aligned_alloc(64, sizeof *at);
    bool ok = plans && order && clocks && at;
    if (ok) {
        *at = (struct arrays){.zero = {0}};
        ok = measure(all, count, settings, plans, order, at, clocks);
    }
    if (ok) {
        printf("{");
        for (int w = 0; w < 4; w++) {
            char name[32];
            snprintf(name, sizeof name, "core_hz_%d", w ? 64 << w : 0);
            print_list(name, clocks + w * settings->rounds, settings->rounds);
            printf(", ");
        }
        printf("\"entries\": [");
        for (size_t k = 0; k < count; k++) {
            printf("%s\n{\"id\": %zu", k ? "," : "", k);
            if (!all[k].missing) {
                printf(", ");
                print_list("stream_ns", plans[k].stream, settings->rounds);
                printf(", ");
                print_list("chain_ns", plans[k].chain, settings->rounds);
            }
            printf("}");
        }
        printf("]}\n");
    }
    for (size_t k = 0; plans && k < count; k++) {
        free(plans[k].stream);
        free(plans[k].chain);
    }
    free(at);
    free(clocks);
    free(order);
    free(plans);
    return ok;
}
