// flags: -mavx2 -mfma -ffp-contract=off
// opt4's log, exp and sin against the C library's double ones, over every float of their ranges.
#include "tests/c/testing.h"

#include <string.h>

#include "phases/opt4/vec.h"

static float from_bits(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

// Error of `got` in units in the last place of `exact` as a float.
static double ulps(float got, double exact) {
    int exponent;
    frexp(exact, &exponent);
    return fabs((double)got - exact) / ldexp(1.0, (exponent < -125 ? -125 : exponent) - 24);
}

typedef double (*exact_function)(double);

// The largest error over the floats whose bits are first, first + stride, … up to last.
static double largest_error(vfloat (*f)(vfloat), exact_function exact, uint32_t first,
                            uint32_t last, uint32_t stride) {
    double largest = 0;
    for (uint64_t i = first; i <= last; i += (uint64_t)LANES * stride) {
        float in[LANES], out[LANES];
        for (int lane = 0; lane < LANES; lane++) {
            uint64_t bits = i + (uint64_t)lane * stride;
            in[lane] = from_bits((uint32_t)(bits <= last ? bits : last));
        }
        _mm256_storeu_ps(out, f(_mm256_loadu_ps(in)));
        for (int lane = 0; lane < LANES; lane++) {
            double error = ulps(out[lane], exact((double)in[lane]));
            if (!(error <= largest))
                largest = error;
        }
    }
    return largest;
}

// Every float of one octave and a stratified 1 in 61 (a prime) of the rest: all of them take
// minutes.
TEST(test_log) {
    double near_one =
        largest_error(log_of, log, 0x3f000000, 0x40000000, 1); // 0.5 … 2: cancellation
    double all = largest_error(log_of, log, 0x00800000, 0x7f7fffff, 61);
    print_message("opt4 log: %.3f ulp in 0.5 to 2, %.3f ulp over all normal floats\n", near_one,
                  all);
    assert_true(near_one <= 1.5);
    assert_true(all <= 1.5);
}

TEST(test_exp) {
    double negative = largest_error(exp_of, exp, 0x80000000, 0xc2ae0000, 61); // −0 … −87
    double positive = largest_error(exp_of, exp, 0x00000000, 0x42b00000, 61); // 0 … 88
    print_message("opt4 exp: %.3f ulp in -87 to 0, %.3f ulp in 0 to 88\n", negative, positive);
    assert_true(negative <= 1.5);
    assert_true(positive <= 1.5);
}

static float lane0(vfloat a) {
    return _mm256_cvtss_f32(a);
}

TEST(test_sin) {
    double worst = 0;
    for (int i = -500000; i <= 500000; i++) { // −1000 … 1000, and as much near 0
        for (int narrow = 0; narrow < 2; narrow++) {
            float x = (float)i * (narrow ? 1e-5f : 2e-3f);
            double error = fabs((double)lane0(sin_of(v_splat(x))) - sin((double)x));
            if (!(error <= worst))
                worst = error;
        }
    }
    print_message("opt4 sin: off by %.3g in -1000 to 1000\n", worst);
    assert_true(worst <= 1.5 * 0x1p-23);
    assert_true(lane0(sin_of(v_splat(0.0f))) == 0.0f);
    assert_true(fabs((double)lane0(cos_of(v_splat(3.0f))) - cos(3.0)) <= 0x1p-22);
}

TEST(test_ends) {
    // What a renderer may feed them: never NaN or infinity out of finite arguments.
    const float inputs[] = {0.0f, 1e-45f, 1e-38f, 3.4e38f, -1e30f, 1e30f};
    for (size_t i = 0; i < LENGTH(inputs); i++) {
        assert_true(isfinite(lane0(exp_of(v_splat(inputs[i])))));
        if (inputs[i] >= 0)
            assert_true(isfinite(lane0(log_of(v_splat(inputs[i])))));
    }
    assert_true(lane0(exp_of(v_splat(0.0f))) == 1.0f);
    assert_true(lane0(log_of(v_splat(1.0f))) == 0.0f);
    assert_true(lane0(power_of(v_splat(0.0f), v_splat(15.0f))) < 1e-30f);
    assert_true(fabs(lane0(power_of(v_splat(0.5f), v_splat(15.0f))) * 32768.0 - 1) < 1e-5);
}

// place_at keeps what float drops: the end point of origin + (t + dt)·direction to 2^-44 of its
// size.
TEST(test_place) {
    uint32_t random = 12345;
    double worst = 0;
    for (int i = 0; i < 1000000; i++) {
        float v[5];
        for (int k = 0; k < 5; k++) {
            random = random * 1664525u + 1013904223u; // Numerical Recipes' LCG: a fixed sequence
            v[k] = (float)((double)(random >> 8) / (1 << 24) * 2 - 1);
        }
        float origin = 50 * v[0], lo = origin * 0x1p-25f * v[1], t = 40 * fabsf(v[2]);
        float direction = v[3], dt = 1e-6f * t * v[4];
        struct point from = {{v_splat(origin), v_splat(0.0f), v_splat(0.0f)},
                             {v_splat(lo), v_splat(0.0f), v_splat(0.0f)}};
        struct vec along = {v_splat(direction), v_splat(0.0f), v_splat(0.0f)};
        struct point p = place_at(from, along, v_splat(t), v_splat(dt));
        double exact = (double)origin + lo + ((double)t + dt) * direction;
        double scale = fmax(fabs((double)origin), fabs((double)t * direction));
        double error = fabs((double)lane0(p.hi.x) + lane0(p.lo.x) - exact) / scale;
        if (!(error <= worst))
            worst = error;
    }
    print_message("opt4 place_at: largest relative error 2^%.1f\n", log2(worst));
    assert_true(worst <= 0x1p-43);
}

RUN_TESTS(NULL, NULL)
