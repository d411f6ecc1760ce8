#include "samples.h"

#include <math.h>
#include <stdlib.h>

#include "timing/timer.h"

double seconds_of(const struct clocks *clocks, uint64_t ticks) {
    return (double)(ticks > clocks->overhead ? ticks - clocks->overhead : 1) / clocks->tsc_hz;
}

void sample(struct samples *s, const struct clocks *clocks, void (*one)(void *), void *what,
            bool warm, double work, int count) {
    double before = timer_core_hz(clocks->tsc_hz, 1);
    for (int tries = 0, good = 0; tries < 8 * count && good < count && s->count < MOST_SAMPLES;
         tries++) {
        if (warm)
            one(what);
        uint64_t begin = timer_tsc_begin();
        one(what);
        double seconds = seconds_of(clocks, timer_tsc_end() - begin);
        double after = timer_core_hz(clocks->tsc_hz, 1);
        if (fabs(after / before - 1) < 0.003) {
            s->per_second[s->count] = work / seconds;
            s->hz[s->count] = (before + after) / 2;
            s->per_cycle[s->count] = work / seconds / s->hz[s->count];
            s->count++;
            good++;
        }
        before = after;
    }
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// The highest of `n` ascending values that has two more within 1 % below it, or else the median.
static double repeated(const double *v, int n) {
    double median = n % 2 ? v[n / 2] : (v[n / 2 - 1] + v[n / 2]) / 2;
    for (int i = n - 1; i >= REPEATED - 1 && v[i] > median; i--)
        if (v[i - (REPEATED - 1)] >= 0.99 * v[i])
            return v[i];
    return median;
}

// 95 % interval of the median by order statistics (binomial, normal approximation): W. J. Conover,
// Practical Nonparametric Statistics, 3rd ed. (1999), section 3.2.
struct summary summarize(struct samples *s) {
    int n = s->count;
    qsort(s->per_cycle, (size_t)n, sizeof *s->per_cycle, ascending);
    qsort(s->per_second, (size_t)n, sizeof *s->per_second, ascending);
    qsort(s->hz, (size_t)n, sizeof *s->hz, ascending);
    int low = (int)floor(n / 2.0 - 0.98 * sqrt(n)), high = (int)ceil(n / 2.0 + 0.98 * sqrt(n));
    const double *v = s->per_cycle;
    return (struct summary){.best = repeated(v, n),
                            .median = n % 2 ? v[n / 2] : (v[n / 2 - 1] + v[n / 2]) / 2,
                            .low = v[low < 0 ? 0 : low],
                            .high = v[high > n - 1 ? n - 1 : high],
                            .worst = v[0],
                            .per_second = repeated(s->per_second, n),
                            .hz = s->hz[n / 2]};
}
