// flags: -mavx2 -mfma -ffp-contract=off
// The bench's copies of opt3's log, exp and power (common/functions/polynomials.h) give its very bits.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "phases/opt3/vec.h"

#define BITS 256
#define DOUBLE 1
#include "common/functions/polynomials.h"

enum { SAMPLES = 1 << 18 };

typedef vdouble (*phase_function)(vdouble);
typedef V (*bench_function)(V);

// Bits spread over all patterns, NaN and negative ones among them, by a multiplier without pattern.
static __m256d doubles_from(uint64_t number) {
    uint64_t in[LANES];
    for (uint64_t lane = 0; lane < LANES; lane++)
        in[lane] = (number * LANES + lane) * 0x9e3779b97f4a7c15;
    __m256d a;
    memcpy(&a, in, sizeof a);
    return a;
}

static void same(phase_function theirs, bench_function ours) {
    for (uint64_t i = 0; i < SAMPLES; i++) {
        __m256d a = doubles_from(i), expected = theirs(a), got = ours(a);
        assert_memory_equal(&expected, &got, sizeof got);
    }
}

// Between −1000 and 1000: few of all patterns are.
static __m256d near_one(__m256d a) {
    for (int lane = 0; lane < LANES; lane++)
        a[lane] = isfinite(a[lane]) ? 1000 * sin(a[lane]) : 1;
    return a;
}

static void test_log(void **state) {
    (void)state;
    same(log_of, poly_log);
}

static void test_exp(void **state) {
    (void)state;
    same(exp_of, poly_exp);
    for (uint64_t i = 0; i < SAMPLES; i++) {
        __m256d a = near_one(doubles_from(i)), expected = exp_of(a), got = poly_exp(a);
        assert_memory_equal(&expected, &got, sizeof got);
    }
}

static void test_power(void **state) {
    (void)state;
    for (uint64_t i = 0; i < SAMPLES; i++) {
        __m256d a = near_one(doubles_from(i)), b = near_one(doubles_from(i + SAMPLES));
        a = v_abs(a);
        __m256d expected = power_of(a, b), got = poly_pow(a, b);
        assert_memory_equal(&expected, &got, sizeof got);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_log), cmocka_unit_test(test_exp),
                                       cmocka_unit_test(test_power)};
    return cmocka_run_group_tests_name("the bench's double functions", tests, NULL, NULL);
}
