// What the files of the function bench share (run by scripts/stepwise functions). An entry is one
// implementation of a function, in one precision at one vector width. scalar_kernels.c and
// vector_kernels.c define the entries; each object of them is compiled for one instruction set.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef void (*library_function)(void); // of any type; kernels cast it to theirs

// Computes n results from independent arguments. The arrays hold floats or doubles, as the entry
// says; n is a multiple of 16. `f`: the library's function if the entry has a `symbol`. `b`: second
// arguments, for functions of two.
typedef void stream_kernel(library_function f, size_t n, const void *a, const void *b, void *out);

// Computes n results in a chain: each argument depends on the last result, as a | (result & zero).
// `zero` points to 64 zero bytes whose value the compiler does not know. A vector kernel computes n
// vectors. Writes the last result to `out`.
typedef void chain_kernel(library_function f, size_t n, const void *a, const void *b,
                          const void *zero, void *out);

struct entry {
    const char *function, *family, *name;
    const char *symbol; // of the library's function; NULL: the kernel contains its own code
    stream_kernel *stream;
    chain_kernel *chain;
};

// Normalises n vectors in place; n is a multiple of 16. Layout "SoA": arrays x, y and z. Layout
// "AoS": x y z triples in x.
struct normaliser {
    const char *name, *layout;
    void (*run)(size_t n, float *x, float *y, float *z);
};

// All entries of one instruction set and precision.
struct entries {
    const char *isa;
    int bits; // width of a vector; of an element in scalar code
    bool is_double;
    size_t count, normalisers;
    const struct entry *entry;
    const struct normaliser *normaliser;
};

extern const struct entries scalar_float, scalar_double, sse_float, sse_double, avx2_float,
    avx2_double, avx512_float, avx512_double;

// An entry, ready to run or with the reason why it cannot.
struct runnable {
    const struct entries *of;
    const struct entry *entry;
    library_function external; // the function that `symbol` names
    const char *missing;       // why it cannot run; NULL: it can
};

// A function with its exact values and the arguments for tests and timing (targets.c).
enum { MAX_SEGMENTS = 6 };
struct segment { // floats from bit pattern `first` to `last`, one in `stride` (1: every one)
    uint32_t first, last, stride;
};
struct target {
    const char *name;
    int arguments;
    double (*exact)(double, double); // reference of the float entries, in double precision
    struct segment segments[MAX_SEGMENTS];
    // Ranges of |argument| to sample, and whether both signs occur. Index 0: float, 1: double.
    struct span {
        double low, high;
        bool both_signs;
    } a[2], b[2];
    struct span timed[2]; // arguments a and b of the timing runs
};
extern const struct target targets[];
extern const size_t target_count;

// Returns the target of that name, NULL if there is none.
const struct target *find_target(const char *function);

// Errors in units in the last place of the exact value: ulp(y) = 2^(e − p + 1) for 2^e ≤ |y| <
// 2^(e+1), where e is at least the format's smallest exponent. J.-M. Muller, "On the definition of
// ulp(x)", INRIA RR-5504, 2005.
struct error {
    double largest;
    double sum_of_squares;   // of the finite errors
    double worst_a, worst_b; // arguments of the largest error
    uint64_t count;          // number of arguments
    uint64_t non_finite;     // results that are NaN or infinite although the exact value is not
};

// Returns one ulp of `exact`, a finite number, in the format float or double.
double ulp_of(double exact, bool is_double);

// Adds `part` to `total`. The sum does not depend on the order of the parts.
void error_add(struct error *total, const struct error *part);

struct random {
    uint64_t state; // the seed at the start
};
double random_unit(struct random *random);

// Returns a random argument from stratum `which` of `strata` equal strata of the span. `by_bits`:
// the strata have equally many floating-point numbers instead of equal widths.
double sample(const struct span *span, uint64_t which, uint64_t strata, bool by_bits,
              bool is_double, struct random *random);

struct settings {
    bool quick;
    int threads, rounds;
    uint64_t seed, vectors;
};

// What the threads of an error search share. Each takes the next item and adds its errors to `errors`.
struct search {
    const struct runnable *all;
    size_t count, items, buffer_size; // entries; items of work; bytes of a thread's buffers
    const struct settings *settings;
    struct error *errors;
    const void *jobs;
    void (*run)(const struct search *search, size_t item, void *buffers, struct error *errors);
};

// The functions below return false if memory is short.

bool search_in_threads(const struct search *search); // sampled.c

// exhaustive.c: adds errors[k] of entry all[k] for float functions of one argument, over all floats
// of their segments (quick: one in 12,289).
bool measure_exhaustive(const struct runnable *all, size_t count, const struct settings *settings,
                        struct error *errors);
// sampled.c: adds the errors of all other entries, over stratified samples. Double entries are left
// out without MPFR.
bool measure_sampled(const struct runnable *all, size_t count, const struct settings *settings,
                     struct error *errors);
extern const bool has_mpfr;

// timing.c and normalise.c: measure times and print them as a JSON object.
bool print_times(const struct runnable *all, size_t count, const struct settings *settings);
bool print_normalise(const struct entries *const *files, size_t count,
                     const struct settings *settings);

// isa.c: returns whether the CPU has the instruction set of these entries.
bool runs_here(const struct entries *of);
