// flags: -mavx2 -mfma -ffp-contract=off
// The bench's copies of opt4's log, exp and power (common/functions/polynomials.h) give its very bits.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "phases/opt4/vec.h"

#define BITS 256
#define DOUBLE 0
#include "common/functions/polynomials.h"

enum { STRIDE = 997 };

typedef vfloat (*phase_function)(vfloat);
typedef V (*bench_function)(V);

static __m256 floats_from(uint32_t bits) {
    uint32_t in[LANES];
    for (uint32_t lane = 0; lane < LANES; lane++)
        in[lane] = bits + lane * STRIDE;
    __m256 a;
    memcpy(&a, in, sizeof a);
    return a;
}

// Over all bit patterns, NaN and negative ones among them.
static void same(phase_function theirs, bench_function ours) {
    for (uint64_t bits = 0; bits < 0x100000000; bits += (uint64_t)LANES * STRIDE) {
        __m256 a = floats_from((uint32_t)bits), expected = theirs(a), got = ours(a);
        assert_memory_equal(&expected, &got, sizeof got);
    }
}

static void test_log(void **state) {
    (void)state;
    same(log_of, poly_log);
}

static void test_exp(void **state) {
    (void)state;
    same(exp_of, poly_exp);
}

static void test_power(void **state) {
    (void)state;
    for (uint32_t bits = 0x3a000000; bits < 0x46000000; bits += LANES * STRIDE) {
        __m256 a = floats_from(bits), b = floats_from(0x7e000000 - bits);
        __m256 expected = power_of(a, b), got = poly_pow(a, b);
        assert_memory_equal(&expected, &got, sizeof got);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_log), cmocka_unit_test(test_exp),
                                       cmocka_unit_test(test_power)};
    return cmocka_run_group_tests_name("the bench's float functions", tests, NULL, NULL);
}
