// The bench's copies of a phase's log, exp and power (common/functions/polynomials.h) give its very bits.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define BITS 256
#include "common/functions/polynomials.h"

enum { SAMPLES = 1 << 19 };

// Bits spread over all patterns, NaN and negative ones among them, by a multiplier without pattern.
static V numbers_from(uint64_t number) {
    uint64_t in[4];
    for (uint64_t k = 0; k < 4; k++)
        in[k] = (number * 4 + k) * 0x9e3779b97f4a7c15;
    V a;
    memcpy(&a, in, sizeof a);
    return a;
}

// Between −1000 and 1000: few of all patterns are.
static V near_one(V a) {
    for (int lane = 0; lane < LANES; lane++)
        a[lane] = isfinite(a[lane]) ? 1000 * sin(a[lane]) : 1;
    return a;
}

static void same(V expected, V got) {
    assert_memory_equal(&expected, &got, sizeof got);
}

static void test_log_and_exp(void **state) {
    (void)state;
    for (uint64_t i = 0; i < SAMPLES; i++) {
        V any = numbers_from(i), near = near_one(any);
        same(log_of(any), poly_log(any));
        same(exp_of(any), poly_exp(any));
        same(exp_of(near), poly_exp(near));
    }
}

static void test_power(void **state) {
    (void)state;
    for (uint64_t i = 0; i < SAMPLES; i++) {
        V a = v_abs(near_one(numbers_from(i))), b = near_one(numbers_from(i + SAMPLES));
        same(power_of(a, b), poly_pow(a, b));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_log_and_exp),
                                       cmocka_unit_test(test_power)};
    return cmocka_run_group_tests_name("the bench's functions", tests, NULL, NULL);
}
