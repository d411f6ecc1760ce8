// The functions under test: exact values, arguments, random samples and errors.
#include <math.h>
#include <string.h>

#include "bench.h"

#define ONE_ARGUMENT(NAME, VALUE)                                                                  \
    static double NAME(double a, double b) {                                                       \
        (void)b;                                                                                   \
        return VALUE;                                                                              \
    }
ONE_ARGUMENT(exact_sqrt, sqrt(a))
ONE_ARGUMENT(exact_rsqrt, 1 / sqrt(a))
ONE_ARGUMENT(exact_exp, exp(a))
ONE_ARGUMENT(exact_log, log(a))
ONE_ARGUMENT(exact_sin, sin(a))
ONE_ARGUMENT(exact_cos, cos(a))
ONE_ARGUMENT(exact_acos, acos(a))

// Bit patterns of floats.
#define SMALLEST_NORMAL 0x00800000u // 2^-126
#define LARGEST_FINITE 0x7f7fffffu  // FLT_MAX
#define TINY 0x30800000u            // 2^-30
#define ONE 0x3f800000u
#define MAX_ANGLE 0x46000000u // 8192
#define NEGATIVE 0x80000000u
// Every float of both signs with magnitude from 2^-30 to LAST. Below 2^-30, f(x) equals x, 1 or π/2
// within half an ulp. There one float in 251 (a prime) is enough, zeros and denormals included.
#define BOTH_SIGNS(LAST_POSITIVE, LAST_NEGATIVE)                                                   \
    {{TINY, LAST_POSITIVE, 1},                                                                     \
     {NEGATIVE | TINY, NEGATIVE | (LAST_NEGATIVE), 1},                                             \
     {0, TINY - 1, 251},                                                                           \
     {NEGATIVE, (NEGATIVE | TINY) - 1, 251}}
#define NORMALS {{SMALLEST_NORMAL, LARGEST_FINITE, 1}}
// clang-format off
#define NONE {0, 0, false}
#define POSITIVE {NONE, {0x1p-1022, 0x1.fffffffffffffp1023, false}}
#define ANGLES BOTH_SIGNS(MAX_ANGLE, MAX_ANGLE), {NONE, {0x1p-60, 1e5, true}}

// name, arguments, exact, segments, a, b, timed
const struct target targets[] = {
    {"sqrt", 1, exact_sqrt, NORMALS, POSITIVE, {NONE}, {{0.001, 1000, false}}},
    {"rsqrt", 1, exact_rsqrt, NORMALS, POSITIVE, {NONE}, {{0.001, 1000, false}}},
    {"exp", 1, exact_exp, BOTH_SIGNS(0x42b00000u, 0x42ae0000u), // −87 … 88
     {NONE, {0x1p-60, 708, true}}, {NONE}, {{0.001, 10, true}}},
    {"log", 1, exact_log, NORMALS, POSITIVE, {NONE}, {{0.001, 1000, false}}},
    {"pow", 2, pow, {{0, 0, 0}}, {{0x1p-10, 0x1p10, false}, {0x1p-10, 0x1p10, false}},
     {{0x1p-10, 12, true}, {0x1p-10, 100, true}}, {{0.01, 10, false}, {0.1, 10, true}}},
    {"sin", 1, exact_sin, ANGLES, {NONE}, {{0.001, 10, true}}},
    {"cos", 1, exact_cos, ANGLES, {NONE}, {{0.001, 10, true}}},
    {"atan2", 2, atan2, {{0, 0, 0}}, {{0x1p-20, 0x1p20, true}, {0x1p-20, 0x1p20, true}},
     {{0x1p-20, 0x1p20, true}, {0x1p-20, 0x1p20, true}}, {{0.001, 10, true}, {0.001, 10, true}}},
    {"acos", 1, exact_acos, BOTH_SIGNS(ONE, ONE), {NONE, {0x1p-60, 1, true}}, {NONE}, {{0.001, 1, true}}},
};
// clang-format on
const size_t target_count = sizeof targets / sizeof *targets;

const struct target *find_target(const char *function) {
    for (size_t i = 0; i < target_count; i++)
        if (strcmp(targets[i].name, function) == 0)
            return &targets[i];
    return NULL;
}

// SplitMix64 (G. L. Steele, D. Lea and C. H. Flood, OOPSLA 2014).
static uint64_t next(struct random *random) {
    uint64_t z = random->state += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
}

double random_unit(struct random *random) {
    return (double)(next(random) >> 11) * 0x1p-53;
}

double sample(const struct span *span, uint64_t which, uint64_t strata, bool by_bits,
              bool is_double, struct random *random) {
    double position = ((double)which + random_unit(random)) / (double)strata, value;
    bool negative = span->both_signs && next(random) & 1;
    if (by_bits) { // interpolates the bit pattern: each binade gets equally many samples
        uint64_t low, high;
        memcpy(&low, &span->low, 8);
        memcpy(&high, &span->high, 8);
        low += (uint64_t)(position * (double)(high - low));
        // position has 53 random bits; the lowest bit of the pattern is drawn separately
        low = low < high ? low ^ (next(random) & 1) : high;
        memcpy(&value, &low, 8);
    } else
        value = span->low + position * (span->high - span->low);
    if (!is_double)
        value = (double)(float)value;
    value = value < span->low ? span->low : value > span->high ? span->high : value;
    return negative ? -value : value;
}

double ulp_of(double exact, bool is_double) {
    int exponent;
    frexp(exact, &exponent);
    int smallest = is_double ? -1021 : -125, digits = is_double ? 53 : 24;
    return ldexp(1, (exponent < smallest ? smallest : exponent) - digits);
}

void error_add(struct error *total, const struct error *part) {
    // The larger argument is kept of two with equal errors, whatever order the threads end in.
    bool tie = part->largest == total->largest && part->worst_a > total->worst_a;
    if (!(part->largest <= total->largest) || tie) {
        total->largest = part->largest;
        total->worst_a = part->worst_a;
        total->worst_b = part->worst_b;
    }
    total->sum_of_squares += part->sum_of_squares;
    total->count += part->count;
    total->non_finite += part->non_finite;
}
