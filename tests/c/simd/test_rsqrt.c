// Approximate reciprocal roots on this CPU: the special values that every maker promises, the error
// over every float of two octaves, and that a packed and a scalar instruction give the same bits
// (Intel SDM vol. 2, RSQRTSS, RSQRTPS; the square root by Newton's step as opt4's ablation has it).
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include <immintrin.h>
#include <math.h>

static float from_bits(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint32_t to_bits(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static float scalar(float x) {
    return _mm_cvtss_f32(_mm_rsqrt_ss(_mm_set_ss(x)));
}

static float packed(float x) {
    float lanes[4];
    _mm_storeu_ps(lanes, _mm_rsqrt_ps(_mm_set1_ps(x)));
    assert_int_equal(to_bits(lanes[0]), to_bits(lanes[3]));
    return lanes[2];
}

static void special_values(void **state) {
    (void)state;
    float (*const both[])(float) = {scalar, packed};
    for (int i = 0; i < 2; i++) {
        assert_true(both[i](0.0f) == INFINITY);
        assert_true(both[i](-0.0f) == -INFINITY);
        assert_int_equal(to_bits(both[i](INFINITY)), 0);
        assert_true(isnan(both[i](NAN)));
        assert_true(isnan(both[i](-1.0f)));
        assert_true(isnan(both[i](-INFINITY)));
        // denormals count as zero: whoever writes √x as x·rsqrt(x) has 1e-40·∞ here
        assert_true(both[i](from_bits(1)) == INFINITY);
        assert_true(both[i](from_bits(0x007fffff)) == INFINITY);
        assert_true(both[i](from_bits(0x80000001)) == -INFINITY);
        assert_true(isfinite(both[i](from_bits(0x00800000))));
    }
}

static void zero_times_infinity_is_nan(void **state) {
    (void)state;
    volatile float zero = 0.0f;
    assert_true(isnan(zero * scalar(zero)));
}

static void error_is_within_the_manuals(void **state) {
    (void)state;
    for (uint32_t bits = 0x3f800000; bits < 0x40800000; bits += 3) { // 1 to 4
        float x = from_bits(bits), y = scalar(x);
        double error = fabs((double)y * sqrt((double)x) - 1.0);
        if (!(error <= 0x1.8p-12))
            fail_msg("rsqrt(%a) = %a, off by %g", (double)x, (double)y, error);
        if (to_bits(y) != to_bits(packed(x)))
            fail_msg("rsqrtss and rsqrtps differ at %a", (double)x);
        // the table repeats with every factor of 4
        if (to_bits(scalar(x * 0x1p40f)) != to_bits(y * 0x1p-20f))
            fail_msg("rsqrt(%a·2^40) is not rsqrt of it·2^-20", (double)x);
    }
}

static void a_newton_step_squares_the_error(void **state) {
    (void)state;
    for (uint32_t bits = 0x3f800000; bits < 0x40800000; bits += 101) {
        float x = from_bits(bits), y = scalar(x);
        double error = (double)y * sqrt((double)x) - 1.0;
        float better = y * (1.5f - 0.5f * x * y * y);
        double left = fabs((double)better * sqrt((double)x) - 1.0);
        // 1.5·e² and four roundings
        if (!(left <= 1.5 * error * error + 4 * 0x1p-24))
            fail_msg("after a step from %g at %a: %g", error, (double)x, left);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(special_values),
        cmocka_unit_test(zero_times_infinity_is_nan),
        cmocka_unit_test(error_is_within_the_manuals),
        cmocka_unit_test(a_newton_step_squares_the_error),
    };
    return cmocka_run_group_tests_name("rsqrt", tests, NULL, NULL);
}
