#include "report.h"

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

static void json_compute(const struct compute *c, struct samples *s) {
    printf("{\"name\": \"%s\", \"precision\": \"%s\", \"bits\": %d, \"loop_operations\": %d, ",
           KIND_NAMES[c->kind], c->is_double ? "double" : "single", c->bits, per_loop(c->kind));
    if (has(c->needs))
        print_spread(s, "flop", flops_of(c));
    else
        print_missing("flop", LACKS, c->needs);
}

static void json_transfer(const struct moving *m, enum level level, const struct place *place,
                          struct samples *s) {
    printf("{\"name\": \"%s\", \"level\": \"%s\", \"bits\": %d, \"loop_bytes\": %d, "
           "\"working_set_bytes\": %zu, \"working_set\": \"%s\", ",
           MOTION_NAMES[m->motion], LEVEL_NAMES[level], m->bits, loop_bytes(m), place->working_set,
           place->rule);
    if (!place->working_set)
        print_missing("byte", place->why, NULL);
    else if (!has(m->needs))
        print_missing("byte", LACKS, m->needs);
    else
        print_spread(s, "byte", m->bits / 8.0); // a copy: two instructions
}

// What all of them share, and the key of their list.
static void json_head(const struct ceilings *all) {
    const struct place *places = all->places;
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
           (int)all->clocks.overhead, places[L1].cache, places[L2].cache, places[L3].cache);
}

void report_json(struct ceilings *all, uint64_t begin) {
    json_head(all);
    for (int k = 0; k < COMPUTES; k++) {
        fputs(k ? ",\n" : "\n", stdout);
        json_compute(&COMPUTE[k], &all->computing[k].samples);
    }
    for (int level = 0; level < LEVELS; level++)
        for (int k = 0; k < KINDS_OF_MOVING; k++) {
            fputs(",\n", stdout);
            json_transfer(&MOVINGS[k], (enum level)level, &all->places[level],
                          &all->transfers[level][k].samples);
        }
    printf("\n], \"seconds\": %.3f}\n", (double)(timer_ns() - begin) / 1e9);
}

static void row(const char *name, const char *what, struct samples *s, const char *unit) {
    if (s->count < REPEATED) {
        printf("%-8s %-22s %s\n", name, what, UNSTEADY);
        return;
    }
    struct summary v = summarize(s);
    printf("%-8s %-22s %8.4g %s/core cycle (median %.4g [%.4g, %.4g], worst %.4g, n = %d), %.4g "
           "G/s\n",
           name, what, v.best, unit, v.median, v.low, v.high, v.worst, s->count,
           v.per_second / 1e9);
}

static void row_compute(const struct compute *c, struct samples *s) {
    if (!has(c->needs)) {
        printf("%-8s %d bits: %s%s\n", KIND_NAMES[c->kind], c->bits, LACKS, c->needs);
        return;
    }
    char what[64];
    snprintf(what, sizeof what, "%s %d bits", c->is_double ? "double" : "single", c->bits);
    row(KIND_NAMES[c->kind], what, s, "flop");
}

static void row_transfer(const struct moving *m, enum level level, const struct place *place,
                         struct samples *s) {
    const char *name = MOTION_NAMES[m->motion];
    if (!place->working_set || !has(m->needs)) {
        printf("%-8s %s %d bits: %s%s\n", name, LEVEL_NAMES[level], m->bits,
               place->working_set ? LACKS : place->why, place->working_set ? m->needs : "");
        return;
    }
    char what[64];
    snprintf(what, sizeof what, "%s %d bits", LEVEL_NAMES[level], m->bits);
    row(name, what, s, "byte");
}

void report_table(struct ceilings *all, int samples) {
    double tsc_hz = all->clocks.tsc_hz;
    printf("TSC %.4f GHz, core %.3f GHz; best of %d samples\n", tsc_hz / 1e9,
           timer_core_hz(tsc_hz, 8) / 1e9, samples);
    for (int k = 0; k < COMPUTES; k++)
        row_compute(&COMPUTE[k], &all->computing[k].samples);
    for (int level = 0; level < LEVELS; level++)
        for (int k = 0; k < KINDS_OF_MOVING; k++)
            row_transfer(&MOVINGS[k], (enum level)level, &all->places[level],
                         &all->transfers[level][k].samples);
}
