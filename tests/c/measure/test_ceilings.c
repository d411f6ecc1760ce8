// What common/ceilings makes of its samples. Its kernels are tested by tests/common/test_ceilings.py.
#include "tests/c/testing.h"

#include "common/ceilings/samples.c"
#include "common/ceilings/working_sets.c"

// A clock taken for too low gives figures that are too high, and never twice the same.
TEST(a_ceiling_repeats_itself) {
    const double scattered[] = {8, 15, 15.9, 15.95, 16, 17, 22, 40};
    assert_float_equal(repeated(scattered, LENGTH(scattered)), 16, 0);
    const double twice[] = {1, 2, 3, 4, 15.9, 16, 16, 82, 82.1};
    assert_float_equal(repeated(twice, LENGTH(twice)), 16, 0);
    const double alike[] = {16, 16, 16};
    assert_float_equal(repeated(alike, LENGTH(alike)), 16, 0);
}

TEST(without_a_repetition_it_is_the_median) {
    const double odd[] = {1, 2, 4, 8, 16};
    assert_float_equal(repeated(odd, LENGTH(odd)), 4, 0);
    const double even[] = {1, 2, 4, 8};
    assert_float_equal(repeated(even, LENGTH(even)), 3, 0);
    const double low[] = {1, 1, 1, 2, 4, 8, 16}; // what repeats below the median is no ceiling
    assert_float_equal(repeated(low, LENGTH(low)), 2, 0);
}

// n = 30: order statistics 10 and 21 of the binomial interval, as Conover's table of 95 % has them.
TEST(the_interval_of_the_median_is_the_binomials) {
    static struct samples samples;
    samples.count = 30;
    for (int i = 0; i < 30; i++) { // in disorder
        samples.per_cycle[i] = 1 + (i * 7) % 30;
        samples.per_second[i] = 100 * samples.per_cycle[i];
        samples.hz[i] = 3e9;
    }
    struct summary summary = summarize(&samples);
    assert_float_equal(summary.median, 15.5, 0);
    assert_float_equal(summary.low, 10, 0);
    assert_float_equal(summary.high, 22, 0); // rounded outwards
    assert_float_equal(summary.worst, 1, 0);
}

TEST(working_sets_are_powers_of_two_and_fit) {
    assert_int_equal(power_of_two(24576), 16384);
    assert_int_equal(power_of_two(16384), 16384);
    assert_int_equal(power_of_two(16383), 8192);
}

RUN_TESTS(NULL, NULL)
