// Vector normalisation in place, after the benchmark of J. Bikker, "Architecture of a Real-Time
// Ray-Tracer": 20 million vectors, scalar over triples (AoS) against SIMD over three arrays (SoA).
// Random directions and lengths; sizes from the L1 cache to 240 MB, and beside them a kernel that
// loads and stores the same bytes and computes next to nothing: where it takes as long, memory is
// what is measured.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "bench.h"
#include "timing/timer.h"

enum { MOST = 32, PASS_NS = 300000 }; // least length of a sample, well under a time slice

struct runner {
    const struct entries *of;
    const struct normaliser *one;
    bool triples;
    double most, squares, count; // error in ulp of each component
};

// A length that is no multiple of 16 would leave the last vectors out.
static const uint64_t SIZES[] = {1024, 16384, 262144, 2097152, 20000000};

static void fill(float *v, uint64_t n, bool triples, uint64_t seed) {
    struct random random = {seed};
    for (uint64_t i = 0; i < n; i++)
        for (uint64_t k = 0; k < 3; k++)
            v[triples ? 3 * i + k : k * n + i] = (float)(2 * random_unit(&random) - 1);
}

// Errors of a block of fresh vectors.
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
            runner->most = e > runner->most ? e : runner->most;
            runner->squares += e * e;
            runner->count++;
        }
    }
}

static double ns_of(const struct runner *runner, float *v, uint64_t n, uint64_t passes) {
    uint64_t begin = timer_ns();
    for (uint64_t i = 0; i < passes; i++)
        runner->one->run(n, v, v + n, v + 2 * n);
    return (double)(timer_ns() - begin) / (double)(passes * n);
}

// ns per vector of each runner: rounds in turn, each beginning with another one.
static void time_size(struct runner *runners, size_t count, float *v, uint64_t n,
                      const struct settings *settings, double *ns) {
    uint64_t passes[MOST];
    for (int round = -1; round < settings->rounds; round++)
        for (size_t i = 0; i < count; i++) {
            size_t k = (i + (size_t)(round + 1)) % count;
            if (round < 0) { // fills the cache and tells how long a pass takes
                fill(v, n, runners[k].triples, settings->seed);
                double pass = ns_of(&runners[k], v, n, 1) * (double)n;
                passes[k] = pass < PASS_NS ? (uint64_t)(PASS_NS / pass) + 1 : 1;
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
    if (runner->count > 0 && isfinite(runner->most))
        printf("%.6g, \"rms_ulp\": %.6g, \"ns\": [", runner->most,
               sqrt(runner->squares / runner->count));
    else
        printf("null, \"rms_ulp\": null, \"ns\": [");
    for (int i = 0; i < rounds; i++)
        printf("%s%.6g", i ? ", " : "", ns[i]);
    printf("]}");
}

bool print_normalise(const struct entries *const *files, size_t count,
                     const struct settings *settings) {
    struct runner runners[MOST];
    size_t used = 0;
    for (size_t f = 0; f < count; f++)
        for (size_t i = 0; has_isa(files[f]->needs) && i < files[f]->normalisers; i++)
            runners[used++] = (struct runner){.of = files[f],
                                              .one = &files[f]->normaliser[i],
                                              .triples = files[f]->normaliser[i].layout[0] == 'A'};
    uint64_t largest = settings->vectors;
    // one array: triples, or x, y and z one after the other
    float *v = aligned_alloc(64, (size_t)(largest * 12 + 63) / 64 * 64);
    double *ns = calloc(used * (size_t)settings->rounds, sizeof *ns);
    bool ok = v && ns;
    bool first = true;
    if (ok) {
        for (size_t k = 0; k < used; k++)
            if (runners[k].one->name[0] != 'n') // "no arithmetic" is no normalisation
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
