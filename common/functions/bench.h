// What the bench of scripts/functions.py is made of: one entry per implementation of a function, in
// one precision at one vector width. The files scalar_*.c and wide_*.c define them, each compiled
// for its own instruction set; nothing of a file is called where the CPU lacks its set.
#ifndef STEPWISE_FUNCTIONS_BENCH_H
#define STEPWISE_FUNCTIONS_BENCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef void (*any_function)(void);

// Arguments and results are floats or doubles as the entry says; lengths are multiples of 16.
// `f`: the library's function where `symbol` names one. `b`: of functions of two arguments.
typedef void stream_kernel(any_function f, size_t n, const void *a, const void *b, void *out);
// Each call's argument waits for the last one's result: a | (result & zero), `zero` 64 zero bytes
// the compiler knows nothing of. Of a vector kernel n counts vectors. `out` gets the last result.
typedef void chain_kernel(any_function f, size_t n, const void *a, const void *b, const void *zero,
                          void *out);

struct entry {
    const char *function, *family, *name, *symbol;
    stream_kernel *stream;
    chain_kernel *chain;
};

// In-place normalisation of n vectors (a multiple of 16): x, y, z arrays, or xyz triples in x.
struct normaliser {
    const char *name, *layout;
    void (*run)(size_t n, float *x, float *y, float *z);
};

// All of one file.
struct entries {
    const char *isa, *needs; // `needs`: in the CPU's own words
    int bits;                // of a vector; of an element where scalar
    bool is_double;
    size_t count, normalisers;
    const struct entry *entry;
    const struct normaliser *normaliser;
};

extern const struct entries scalar_float, scalar_double, sse_float, sse_double, avx2_float,
    avx2_double, avx512_float, avx512_double;

// An entry that can run here, or why it cannot.
struct runnable {
    const struct entries *of;
    const struct entry *entry;
    any_function external; // of `symbol`
    const char *missing;   // NULL: it runs
};

// What is asked of a function: common/functions/targets.c.
enum { MOST_SEGMENTS = 6 };
struct segment { // floats by their bits, first to last, one in `stride` (1: every one)
    uint32_t first, last, stride;
};
struct target {
    const char *name;
    int arguments;
    double (*exact)(double, double); // in double: reference of the float entries
    struct segment segments[MOST_SEGMENTS];
    // Samples of argument a or b, by precision (0 float, 1 double): magnitudes and whether both
    // signs.
    struct span {
        double low, high;
        bool both_signs;
    } a[2], b[2], timed[2]; // timed: arguments of the timing runs, a and b
};
extern const struct target targets[];
extern const size_t target_count;
const struct target *target_of(const char *function);

// Errors in units in the last place of the exact value: ulp(y) = 2^(e − p + 1) for 2^e ≤ |y| <
// 2^(e+1), not below the format's least exponent (J.-M. Muller, "On the definition of ulp(x)",
// INRIA RR-5504, 2005).
struct error {
    double most, squares;       // largest; sum of squares of the finite ones
    double worst_a, worst_b;    // where the largest was
    uint64_t count, non_finite; // arguments; results that are NaN or infinite where none should be
};
double ulp_of(double exact, bool is_double);
void error_add(struct error *total, const struct error *part);

// One element's argument from its span: `which` of `strata` strata, by value or by bits.
struct random {
    uint64_t state;
};
double random_unit(struct random *random); // [0, 1)
double sample(const struct span *span, uint64_t which, uint64_t strata, bool by_bits,
              bool is_double, struct random *random);

struct settings {
    bool quick;
    int threads, rounds;
    uint64_t seed, vectors;
};
bool measure_errors(const struct runnable *all, size_t count, const struct settings *settings,
                    struct error *errors);
bool measure_sampled(const struct runnable *all, size_t count, const struct settings *settings,
                     struct error *errors); // functions of two arguments, and all in double
bool print_times(const struct runnable *all, size_t count, const struct settings *settings);
bool print_normalise(const struct entries *const *files, size_t count,
                     const struct settings *settings);

// Returns whether the CPU has all instruction sets of `needs`, words like "avx2 fma" separated by blanks.
bool has_isa(const char *needs);
extern const bool has_mpfr;

#endif
