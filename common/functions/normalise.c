// Vector normalisation in place, after the benchmark of J. Bikker, "Architecture of a Real-Time
// Ray-Tracer": 20 million vectors, scalar code on triples (AoS) against SIMD on three arrays (SoA).
// Vectors have random directions and lengths; sizes range from the L1 cache to 240 MB. One kernel
// loads and stores the same bytes without arithmetic: if it takes as long, memory is the limit.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "bench.h"
#include "timing/timer.h"

enum { MAX_RUNNERS = 32, SAMPLE_NS = 300000 }; // minimum length of a sample

struct runner {
    const struct entries *of;
    const struct normaliser *one;
    bool triples;
    double largest, sum_of_squares, count; // errors of the components, in ulp
};

// Multiples of 16, as kernels require.
static const uint64_t SIZES[] = {1024, 16384, 262144, 2097152, 20000000};

static void fill(float *v, uint64_t n, bool triples, uint64_t seed) {
    struct random random = {seed};
    for (uint64_t i = 0; i < n; i++)
        for (uint64_t k = 0; k < 3; k++)
            v[triples ? 3 * i + k : k * n + i] = (float)(2 * random_unit(&random) - 1);
}

// Adds the errors of n newly drawn vectors.
static void check(struct runner *runner, float *v, uint64_t n, uint64_t seed) {
    fill(v, n, runner->triples, seed);
    runner->one->run(n, v, v + n, v + 2 * n);
    struct random random = {seed};
    for (uint64_t i = 0; i < n; i++) {
        double exact[3], length = 0;
        for (uint64_t k = 0; k < 3; k++) {
            exact[k] = (double)(float)(2 * random_unit(&random) - 1);
            length += exact[k] * exact[k];
        }
        for (uint64_t k = 0; k < 3; k++) {
            double unit = exact[k] / sqrt(length);
            float got = v[runner->triples ? 3 * i + k : k * n + i];
            int exponent;
            frexp(unit, &exponent);
            double e = fabs((double)got - unit) / ldexp(1, exponent - 24);
            e = isfinite(e) ? e : INFINITY;
            runner->largest = e > runner->largest ? e : runner->largest;
            runner->sum_of_squares += e * e;
            runner->count++;
        }
    }
}

// Time per vector in ns.
static double ns_of(const struct runner *runner, float *v, uint64_t n, uint64_t passes) {
    uint64_t begin = timer_ns();
    for (uint64_t i = 0; i < passes; i++)
        runner->one->run(n, v, v + n, v + 2 * n);
    return (double)(timer_ns() - begin) / (double)(passes * n);
}

// Times each runner, in ns per vector. Every round starts with another runner.
static void time_size(struct runner *runners, size_t count, float *v, uint64_t n,
                      const struct settings *settings, double *ns) {
    uint64_t passes[MAX_RUNNERS];
    for (int round = -1; round < settings->rounds; round++)
        for (size_t i = 0; i < count; i++) {
            size_t k = (i + (size_t)(round + 1)) % count;
            if (round < 0) { // warms the cache and measures the length of a pass
                fill(v, n, runners[k].triples, settings->seed);
                double pass = ns_of(&runners[k], v, n, 1) * (double)n;
                passes[k] = pass < SAMPLE_NS ? (uint64_t)(SAMPLE_NS / pass) + 1 : 1;
            } else
                ns[k * (size_t)settings->rounds + (size_t)round] =
                    ns_of(&runners[k], v, n, passes[k]);
        }
}

static void print_runner(const struct runner *runner, uint64_t n, const double *ns, int rounds) {
    printf("{\"vectors\": %llu, \"isa\": \"%s\", \"bits\": %d, \"name\": \"%s\", \"layout\": "
           "\"%s\", \"max_ulp\": ",
           (unsigned long long)n, runner->of->isa, runner->of->bits, runner->one->name,
           runner->one->layout);
    if (runner->count > 0 && isfinite(runner->largest))
        printf("%.6g, \"rms_ulp\": %.6g, \"ns\": [", runner->largest,
               sqrt(runner->sum_of_squares / runner->count));
    else
        printf("null, \"rms_ulp\": null, \"ns\": [");
    for (int i = 0; i < rounds; i++)
        printf("%s%.6g", i ? ", " : "", ns[i]);
    printf("]}");
}

bool print_normalise(const struct entries *const *files, size_t count,
                     const struct settings *settings) {
    struct runner runners[MAX_RUNNERS];
    size_t used = 0;
    for (size_t f = 0; f < count; f++)
        for (size_t i = 0; runs_here(files[f]) && i < files[f]->normalisers; i++)
            runners[used++] = (struct runner){.of = files[f],
                                              .one = &files[f]->normaliser[i],
                                              .triples = files[f]->normaliser[i].layout[0] == 'A'};
    uint64_t largest = settings->vectors;
    // Holds triples, or the arrays x, y and z one after the other.
    float *v = aligned_alloc(64, (size_t)(largest * 12 + 63) / 64 * 64);
    double *ns = calloc(used * (size_t)settings->rounds, sizeof *ns);
    bool ok = v && ns;
    bool first = true;
    if (ok) {
        for (size_t k = 0; k < used; k++)
            if (runners[k].one->name[0] != 'n') // not for "no arithmetic", which normalises nothing
                for (uint64_t block = 0; block < 16; block++)
                    check(&runners[k], v, 1024, settings->seed + block);
        printf("{\"rows\": [");
        for (size_t s = 0; s < sizeof SIZES / sizeof *SIZES; s++) {
            uint64_t n = SIZES[s] < largest ? SIZES[s] : largest;
            time_size(runners, used, v, n, settings, ns);
            for (size_t k = 0; k < used; k++, first = false) {
                printf(first ? "\n" : ",\n");
                print_runner(&runners[k], n, ns + k * (size_t)settings->rounds, settings->rounds);
            }
            if (n == largest)
                break;
        }
        printf("]}\n");
    }
    free(ns);
    free(v);
    return ok;
}
