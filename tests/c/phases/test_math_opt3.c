// flags: -mavx2 -mfma -ffp-contract=off
// opt3's log, exp and sin against the C library's long double ones, on stratified samples.
#include "tests/c/testing.h"

#include "phases/opt3/vec.h"

static double ulps(double got, long double exact) {
    int exponent;
    frexpl(exact, &exponent);
    long double error = fabsl((long double)got - exact);
    return (double)(error / ldexpl(1.0L, (exponent < -1021 ? -1021 : exponent) - 53));
}

static double lane0(vdouble a) {
    return _mm256_cvtsd_f64(a);
}

// A fixed sequence in [0, 1): Weyl's, by the golden ratio.
static double weyl(uint32_t i) {
    double x = i * 0.61803398874989484820;
    return x - floor(x);
}

enum { SAMPLES = 2000000 };

TEST(test_log) {
    double near_one = 0, all = 0;
    for (uint32_t i = 0; i < SAMPLES; i++) {
        double x = 0.5 + 1.5 * weyl(i); // 0.5 … 2: cancellation
        double error = ulps(lane0(log_of(v_splat(x))), logl((long double)x));
        if (!(error <= near_one))
            near_one = error;
        double y = ldexp(1.0 + weyl(i), (int)(i % 2045) - 1022); // all normal doubles
        error = ulps(lane0(log_of(v_splat(y))), logl((long double)y));
        if (!(error <= all))
            all = error;
    }
    print_message("opt3 log: %.3f ulp in 0.5 to 2, %.3f ulp over all normal doubles\n", near_one,
                  all);
    assert_true(near_one <= 2);
    assert_true(all <= 2);
}

TEST(test_exp) {
    double worst = 0, small = 0;
    for (uint32_t i = 0; i < SAMPLES; i++) {
        double x = -708.0 + 1417.0 * weyl(i), tiny = ldexp(weyl(i) - 0.5, -(int)(i % 60));
        double error = ulps(lane0(exp_of(v_splat(x))), expl((long double)x));
        if (!(error <= worst))
            worst = error;
        error = ulps(lane0(exp_of(v_splat(tiny))), expl((long double)tiny));
        if (!(error <= small))
            small = error;
    }
    print_message("opt3 exp: %.3f ulp in -708 to 709, %.3f ulp near 0\n", worst, small);
    assert_true(worst <= 2);
    assert_true(small <= 2);
}

TEST(test_sin) {
    double worst = 0;
    for (uint32_t i = 0; i < SAMPLES; i++) {
        double x = (weyl(i) - 0.5) * 2000.0 * ldexp(1.0, -(int)(i % 40));
        double error = (double)fabsl(lane0(sin_of(v_splat(x))) - sinl((long double)x));
        if (!(error <= worst))
            worst = error;
    }
    print_message("opt3 sin: off by %.3g in -1000 to 1000\n", worst);
    assert_true(worst <= 0x1p-52);
    assert_true(lane0(sin_of(v_splat(0.0))) == 0.0);
    assert_true(fabs(lane0(cos_of(v_splat(3.0))) - cos(3.0)) <= 0x1p-51);
}

TEST(test_ends) {
    const double inputs[] = {0.0, 4.9e-324, 2.3e-308, 1.7e308, -1e300, 1e300};
    for (size_t i = 0; i < LENGTH(inputs); i++) {
        assert_true(isfinite(lane0(exp_of(v_splat(inputs[i])))));
        if (inputs[i] >= 0)
            assert_true(isfinite(lane0(log_of(v_splat(inputs[i])))));
    }
    assert_true(lane0(exp_of(v_splat(0.0))) == 1.0);
    assert_true(lane0(log_of(v_splat(1.0))) == 0.0);
    assert_true(fabs(lane0(power_of(v_splat(0.5), v_splat(15.0))) * 32768.0 - 1) < 1e-14);
}

RUN_TESTS(NULL, NULL)
