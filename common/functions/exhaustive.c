// Errors of float functions of one argument, over every float of their segments. The reference is the
// C library's double function. Its error, at most 2 ulp of double, is 2^-28 ulp of float.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"

enum { BLOCK = 4096, GROUP = 64, QUICK_STRIDE = 12289, LANES = 8 };

struct job { // at most BLOCK · GROUP arguments of one segment
    const struct target *target;
    uint32_t first, last, stride;
};

struct buffers {
    float a[BLOCK], got[BLOCK];
    double exact[BLOCK], per_ulp[BLOCK]; // per_ulp: 1 / (ulp of exact in float)
};

// 1 / (ulp of exact in float): 2^(23 − e) for 2^e ≤ |exact| < 2^(e+1), e ≥ −126.
static double ulps_per_unit(double exact) {
    uint64_t bits;
    memcpy(&bits, &exact, sizeof bits);
    uint64_t biased = bits >> 52 & 0x7ff; // e + 1023
    biased = biased < 1023 - 126 ? 1023 - 126 : biased;
    bits = (1023 + 23 + 1023 - biased) << 52;
    double result;
    memcpy(&result, &bits, sizeof result);
    return result;
}

// Errors of `count` ≤ BLOCK results. A NaN or infinity counts as non-finite, with an infinite error.
static inline __attribute__((always_inline)) struct error compare_each(const struct buffers *at,
                                                                       size_t count) {
    double most[LANES] = {0}, squares[LANES] = {0}, good[LANES] = {0};
    size_t whole = count / LANES * LANES;
    for (size_t i = 0; i < whole; i += LANES)
        for (size_t k = 0; k < LANES; k++) {
            double e = fabs((double)at->got[i + k] - at->exact[i + k]) * at->per_ulp[i + k];
            double finite = e <= 0x1p1000 ? e : 0;
            good[k] += e <= 0x1p1000 ? 1 : 0;
            squares[k] += finite * finite;
            most[k] = finite > most[k] ? finite : most[k];
        }
    struct error sum = {.count = count};
    double numbers = 0;
    for (size_t k = 0; k < LANES; k++) {
        numbers += good[k];
        sum.sum_of_squares += squares[k];
        sum.largest = most[k] > sum.largest ? most[k] : sum.largest;
    }
    for (size_t i = whole; i < count; i++) {
        double e = fabs((double)at->got[i] - at->exact[i]) * at->per_ulp[i];
        if (e <= 0x1p1000) {
            numbers++;
            sum.sum_of_squares += e * e;
            sum.largest = e > sum.largest ? e : sum.largest;
        }
    }
    sum.non_finite = count - (uint64_t)numbers;
    if (sum.non_finite)
        sum.largest = INFINITY;
    return sum;
}

#ifdef __x86_64__
// For AVX2, because half of the search's time is spent here.
__attribute__((target("avx2"))) static struct error compare_avx2(const struct buffers *at,
                                                                 size_t count) {
    return compare_each(at, count);
}

static struct error compare(const struct buffers *at, size_t count) {
    return __builtin_cpu_supports("avx2") ? compare_avx2(at, count) : compare_each(at, count);
}
#else
static struct error compare(const struct buffers *at, size_t count) {
    return compare_each(at, count);
}
#endif

// Looks for the argument of the largest error, which `error` already holds.
static void find_worst(const struct buffers *at, size_t count, struct error *error) {
    for (size_t i = 0; i < count; i++) {
        double e = fabs((double)at->got[i] - at->exact[i]) * at->per_ulp[i];
        if (!(e < error->largest)) {
            error->worst_a = at->a[i];
            return;
        }
    }
}

// Runs all float entries of the job's function on its arguments.
static void run_job(const struct search *search, size_t item, void *buffers, struct error *errors) {
    const struct job *job = (const struct job *)search->jobs + item;
    struct buffers *at = buffers;
    uint64_t bits = job->first;
    while (bits <= job->last) {
        size_t count = 0;
        for (; count < BLOCK && bits <= job->last; count++, bits += job->stride) {
            uint32_t low = (uint32_t)bits;
            memcpy(&at->a[count], &low, sizeof low);
            at->exact[count] = job->target->exact(at->a[count], 0);
        }
        for (size_t i = 0; i < count; i++)
            at->per_ulp[i] = ulps_per_unit(at->exact[i]);
        for (size_t i = count; i % 16; i++)
            at->a[i] = at->a[0]; // fills the last vector
        for (size_t k = 0; k < search->count; k++) {
            const struct runnable *one = &search->all[k];
            if (one->missing || one->of->is_double ||
                strcmp(one->entry->function, job->target->name) != 0)
                continue;
            one->entry->stream(one->external, (count + 15) / 16 * 16, at->a, NULL, at->got);
            struct error here = compare(at, count);
            if (here.largest > 0 && !(here.largest < errors[k].largest))
                find_worst(at, count, &here);
            error_add(&errors[k], &here);
        }
    }
}

// Splits all segments into jobs and returns their number. `jobs` NULL: only counts them.
static size_t split_into_jobs(const struct settings *settings, struct job *jobs) {
    size_t count = 0;
    for (size_t t = 0; t < target_count; t++)
        for (int s = 0; s < MAX_SEGMENTS && targets[t].segments[s].stride; s++) {
            const struct segment *segment = &targets[t].segments[s];
            uint64_t stride = segment->stride * (settings->quick ? (uint64_t)QUICK_STRIDE : 1);
            for (uint64_t first = segment->first; first <= segment->last;
                 first += stride * BLOCK * GROUP) {
                uint64_t last = first + stride * BLOCK * GROUP - 1;
                if (jobs)
                    jobs[count] = (struct job){
                        &targets[t], (uint32_t)first,
                        (uint32_t)(last < segment->last ? last : segment->last), (uint32_t)stride};
                count++;
            }
        }
    return count;
}

bool measure_exhaustive(const struct runnable *all, size_t count, const struct settings *settings,
                        struct error *errors) {
    size_t items = split_into_jobs(settings, NULL);
    struct job *jobs = calloc(items, sizeof *jobs);
    if (jobs)
        split_into_jobs(settings, jobs);
    bool ok = jobs && search_in_threads(&(struct search){all, count, items, sizeof(struct buffers),
                                                         settings, errors, jobs, run_job});
    free(jobs);
    return ok;
}
