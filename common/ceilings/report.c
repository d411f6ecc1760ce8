// Prints measured ceilings on standard output.
#include "measure.h"

#include <stdio.h>

#include "timing/timer.h"

static const char *const UNSTEADY = "the core clock never held still long enough";

static const char *const LACKS = "this CPU lacks ";

static void print_missing(const char *unit, const char *why, const char *needs) {
    printf("\"value\": null, \"unit\": \"%s/core cycle\", \"reason\": \"%s%s\"}", unit, why,
           needs ? needs : "");
}

static void print_spread(struct samples *s, const char *unit, double instruction) {
    if (s->count < REPEATED) {
        print_missing(unit, UNSTEADY, NULL);
        return;
    }
    struct summary v = summarize(s);
    printf("\"value\": %.6g, \"unit\": \"%s/core cycle\", \"median\": %.6g, \"low\": %.6g, "
           "\"high\": %.6g, "
           "\"worst\": %.6g, \"samples\": %d, \"per_second\": %.6g, "
           "\"instructions_per_core_cycle\": %.6g, "
           "\"core_hz\": %.6g}",
           v.best, unit, v.median, v.low, v.high, v.worst, s->count, v.per_second,
           v.best / instruction, v.hz);
}

static void json_arithmetic(const struct arithmetic_kernel *c, struct samples *s) {
    printf("{\"name\": \"%s\", \"precision\": \"%s\", \"bits\": %d, \"loop_operations\": %d, ",
           KIND_NAMES[c->kind], c->is_double ? "double" : "single", c->bits,
           operations_per_loop(c->kind));
    if (cpu_supports(c->needs))
        print_spread(s, "flop", flops_per_operation(c));
    else
        print_missing("flop", LACKS, c->needs);
}

static void json_transfer(const struct transfer_kernel *m, enum level level,
                          const struct working_set *set, struct samples *s) {
    printf("{\"name\": \"%s\", \"level\": \"%s\", \"bits\": %d, \"loop_bytes\": %d, "
           "\"working_set_bytes\": %zu, \"working_set\": \"%s\", ",
           TRANSFER_NAMES[m->kind], LEVEL_NAMES[level], m->bits, bytes_per_loop(m), set->bytes,
           set->rule);
    if (!set->bytes)
        print_missing("byte", set->missing, NULL);
    else if (!cpu_supports(m->needs))
        print_missing("byte", LACKS, m->needs);
    else
        print_spread(s, "byte", m->bits / 8.0); // a copy: two instructions
}

// Prints what all ceilings have in common, and the key of their list.
static void json_head(const struct ceilings *all) {
    const struct working_set *working_sets = all->working_sets;
    double tsc_hz = all->clocks.tsc_hz, core_hz = timer_core_hz(tsc_hz, 8);
    printf("{\"schema\": 1, \"compiler\": \"" __VERSION__
           "\", \"tsc_hz\": %.10g, \"core_hz\": %.6g, \"core_hz_load\": {",
           tsc_hz, core_hz);
    for (int bits = 128; bits <= 512; bits *= 2) {
        double hz = timer_core_hz_under_load(tsc_hz, 8, bits);
        printf("%s\"%d\": ", bits > 128 ? ", " : "", bits);
        printf(hz > 0 ? "%.6g" : "null", hz);
    }
    printf("}, \"timer_overhead_cycles\": %d, "
           "\"cache_bytes\": {\"L1\": %zu, \"L2\": %zu, \"L3\": %zu}, "
           "\"estimate\": \"value: the best that was seen three times; median, low and high: "
           "median and its 95 %% interval\", \"ceilings\": [",
           (int)all->clocks.overhead, working_sets[L1].cache_bytes, working_sets[L2].cache_bytes,
           working_sets[L3].cache_bytes);
}

void report_json(struct ceilings *all, uint64_t begin) {
    json_head(all);
    for (int k = 0; k < ARITHMETIC_KERNEL_COUNT; k++) {
        fputs(k ? ",\n" : "\n", stdout);
        json_arithmetic(&ARITHMETIC_KERNELS[k], &all->arithmetic_runs[k].samples);
    }
    for (int level = 0; level < LEVELS; level++)
        for (int k = 0; k < TRANSFER_KERNEL_COUNT; k++) {
            fputs(",\n", stdout);
            json_transfer(&TRANSFER_KERNELS[k], (enum level)level, &all->working_sets[level],
                          &all->transfer_runs[level][k].samples);
        }
    printf("\n], \"seconds\": %.3f}\n", (double)(timer_ns() - begin) / 1e9);
}
