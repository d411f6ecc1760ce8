// Errors over stratified samples. Double functions are compared with MPFR (L. Fousse, G. Hanrot, V.
// Lefèvre, P. Pélissier and P. Zimmermann, ACM TOMS 33(2), 2007), float functions of two arguments
// with the C library's double functions.
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "workers/workers.h"

#ifdef WITH_MPFR
#include <mpfr.h>
const bool has_mpfr = true;
#else
const bool has_mpfr = false;
#endif

enum {
    BLOCK = 1024,
    DOUBLES = 1 << 20, // samples per function
    QUICK_DOUBLES = 1 << 12,
    FLOATS = 1 << 24,
    QUICK_FLOATS = 1 << 16
};

// Arguments, results, and exact values as hi + lo.
struct buffers {
    double a[BLOCK], b[BLOCK], got[BLOCK], hi[BLOCK], lo[BLOCK];
    float fa[BLOCK], fb[BLOCK], fgot[BLOCK];
};

#ifdef WITH_MPFR
static void mpfr_reference(const struct target *target, double a, double b, double *hi,
                           double *lo) {
    enum { PRECISION = 140 };
    mpfr_t x, y, exact, rest;
    mpfr_inits2(PRECISION, x, y, exact, rest, (mpfr_ptr)0);
    mpfr_set_d(x, a, MPFR_RNDN);
    mpfr_set_d(y, b, MPFR_RNDN);
    const char *name = target->name;
    static const struct {
        const char *name;
        int (*function)(mpfr_t, const mpfr_t, mpfr_rnd_t);
    } one[] = {{"sqrt", mpfr_sqrt}, {"rsqrt", mpfr_rec_sqrt}, {"exp", mpfr_exp},  {"log", mpfr_log},
               {"sin", mpfr_sin},   {"cos", mpfr_cos},        {"acos", mpfr_acos}};
    if (strcmp(name, "pow") == 0)
        mpfr_pow(exact, x, y, MPFR_RNDN);
    else if (strcmp(name, "atan2") == 0)
        mpfr_atan2(exact, x, y, MPFR_RNDN);
    for (size_t i = 0; i < sizeof one / sizeof *one; i++)
        if (strcmp(name, one[i].name) == 0)
            one[i].function(exact, x, MPFR_RNDN);
    *hi = mpfr_get_d(exact, MPFR_RNDN);
    mpfr_sub_d(rest, exact, *hi, MPFR_RNDN);
    *lo = mpfr_get_d(rest, MPFR_RNDN);
    mpfr_clears(x, y, exact, rest, (mpfr_ptr)0);
}
#else
static void mpfr_reference(const struct target *target, double a, double b, double *hi,
                           double *lo) {
    *hi = target->exact(a, b); // not called: without MPFR, doubles are left out
    *lo = 0;
}
#endif

// Draws BLOCK arguments, from sample `first` of `total` on, and computes their exact values. Half of
// the strata have equal widths, half have equally many floats. For sin and cos in double a quarter
// lies next to multiples of π/2, where range reduction cancels. The strata of b are permuted.
static void draw(const struct target *target, bool is_double, uint64_t first, uint64_t total,
                 struct random *random, struct buffers *at) {
    bool turns =
        is_double && (strcmp(target->name, "sin") == 0 || strcmp(target->name, "cos") == 0);
    for (size_t i = 0; i < BLOCK; i++) {
        uint64_t which = first + i;
        bool by_bits = which & 1;
        at->a[i] = sample(&target->a[is_double], which, total, by_bits, is_double, random);
        if (turns && which % 4 == 2) {
            double k = nearbyint(at->a[i] / M_PI_2);
            at->a[i] =
                k == 0 ? at->a[i] : nextafter(k * M_PI_2, random_unit(random) < 0.5 ? 0 : 1e9);
        }
        uint64_t other =
            (which * 0x9e3779b1u) % total; // a permutation: odd factor, total a power of 2
        at->b[i] = target->arguments == 2 ? sample(&target->b[is_double], other, total,
                                                   which >> 1 & 1, is_double, random)
                                          : 0;
        at->fa[i] = (float)at->a[i];
        at->fb[i] = (float)at->b[i];
        if (is_double)
            mpfr_reference(target, at->a[i], at->b[i], &at->hi[i], &at->lo[i]);
        else {
            at->hi[i] = target->exact(at->a[i], at->b[i]);
            at->lo[i] = 0;
        }
    }
}

static struct error compare(const struct buffers *at, bool is_double) {
    struct error sum = {.count = BLOCK};
    for (size_t i = 0; i < BLOCK; i++) {
        double got = is_double ? at->got[i] : (double)at->fgot[i];
        double e = fabs((got - at->hi[i]) - at->lo[i]) / ulp_of(at->hi[i], is_double);
        if (!isfinite(e)) {
            sum.non_finite++;
            e = INFINITY;
        } else
            sum.sum_of_squares += e * e;
        if (e > sum.largest) {
            sum.largest = e;
            sum.worst_a = at->a[i];
            sum.worst_b = at->b[i];
        }
    }
    return sum;
}

// Runs all entries of a target and precision on one block. The random numbers depend only on the
// seed, the target, the precision and `first`, not on the threads.
static void run_block(const struct search *search, const struct target *target, bool is_double,
                      uint64_t first, uint64_t total, struct buffers *at, struct error *errors) {
    struct random random = {search->settings->seed ^ (first << 8) ^
                            (uint64_t)(target - targets) << 2 ^ is_double};
    draw(target, is_double, first, total, &random, at);
    for (size_t k = 0; k < search->count; k++) {
        const struct runnable *one = &search->all[k];
        if (one->missing || one->of->is_double != is_double ||
            strcmp(one->entry->function, target->name) != 0)
            continue;
        if (is_double)
            one->entry->stream(one->external, BLOCK, at->a, at->b, at->got);
        else
            one->entry->stream(one->external, BLOCK, at->fa, at->fb, at->fgot);
        struct error here = compare(at, is_double);
        error_add(&errors[k], &here);
    }
}

static uint64_t samples_of(const struct settings *settings, bool is_double) {
    if (is_double && !has_mpfr)
        return 0;
    return settings->quick ? (is_double ? QUICK_DOUBLES : QUICK_FLOATS)
           : is_double     ? DOUBLES
                           : FLOATS;
}

static void run_item(const struct search *search, size_t item, void *buffers,
                     struct error *errors) {
    uint64_t doubles = samples_of(search->settings, true);
    uint64_t floats = samples_of(search->settings, false), blocks = (doubles + floats) / BLOCK;
    const struct target *target = &targets[item / blocks];
    uint64_t first = item % blocks * BLOCK;
    if (first < doubles)
        run_block(search, target, true, first, doubles, buffers, errors);
    else if (target->arguments == 2)
        run_block(search, target, false, first - doubles, floats, buffers, errors);
}

// A worker's memory: the buffers, then the errors of its item.
static void search_item(const void *job, int item, void *scratch) {
    static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    const struct search *search = job;
    struct error *errors = (struct error *)((char *)scratch + search->buffer_size);
    search->run(search, (size_t)item, scratch, errors);
    pthread_mutex_lock(&lock);
    for (size_t k = 0; k < search->count; k++)
        error_add(&search->errors[k], &errors[k]);
    pthread_mutex_unlock(&lock);
    memset(errors, 0, search->count * sizeof *errors);
#ifdef WITH_MPFR
    mpfr_free_cache(); // each thread has its own
#endif
}

bool search_in_threads(const struct search *search) {
    size_t scratch_size = search->count * sizeof *search->errors + search->buffer_size;
    struct workers *workers = workers_start(search->settings->threads, scratch_size);
    if (!workers)
        return false;
    workers_run(workers, search_item, search, (int)search->items);
    workers_end(workers);
    return true;
}

bool measure_sampled(const struct runnable *all, size_t count, const struct settings *settings,
                     struct error *errors) {
    uint64_t samples = samples_of(settings, true) + samples_of(settings, false);
    size_t items = (size_t)(samples / BLOCK) * target_count;
    return search_in_threads(&(struct search){all, count, items, sizeof(struct buffers), settings,
                                              errors, NULL, run_item});
}
