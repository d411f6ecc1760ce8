// flags: -O1 -iquote systems/fixed
// The fixed-point arithmetic of phase fixed over its stated ranges: products against 128-bit integers, roots against
// long doubles, whose own error is 2^-64.
#include "tests/c/testing.h"

#include <math.h>

#include "systems/fixed/number/number.h"

__extension__ typedef __int128 wide; // no product is too large for it

static uint64_t seed = 1;

static uint64_t random_bits(void) { // Knuth's MMIX LCG, its upper half twice
    uint64_t high = (seed = seed * 6364136223846793005u + 1442695040888963407u) >> 32;
    return high << 32 | (seed = seed * 6364136223846793005u + 1442695040888963407u) >> 32;
}

// A number of random size, so that small ones are met as often as large ones; 1 to 2^bits − 1.
static int64_t random_up_to(int bits) {
    int size = 1 + (int)(random_bits() % (unsigned)bits);
    return (int64_t)((random_bits() >> (64 - size)) | UINT64_C(1) << (size - 1));
}

static int64_t random_factor(void) {
    int64_t a = random_up_to(31);
    return random_bits() & 1 ? a : -a;
}

static int64_t floor_shift(wide a, int by) {
    wide unit = (wide)1 << by, down = a / unit;
    return (int64_t)(down - (down * unit > a));
}

TEST(products_are_floors) {
    for (int bits = 8; bits <= 28; bits++) {
        const struct format f = {.bits = bits};
        for (int i = 0; i < 20000; i++) {
            int64_t a = random_factor(), b = random_factor();
            assert_int_equal(v_mul(a, b, &f), floor_shift((wide)a * b, bits));
            struct vec u = {random_factor() / 2, random_factor() / 2, random_factor() / 2};
            struct vec v = {random_factor() / 2, random_factor() / 2, random_factor() / 2};
            wide sum = (wide)u.x * v.x + (wide)u.y * v.y + (wide)u.z * v.z;
            assert_int_equal(v_dot(u, v, &f), floor_shift(sum, bits));
        }
        const int64_t most = INT32_MAX, least = INT32_MIN;
        assert_int_equal(v_mul(most, least, &f), floor_shift((wide)most * least, bits));
        assert_int_equal(v_mul(least, least, &f), floor_shift((wide)least * least, bits));
    }
}

// What magic and Newton leave, from mathematics: each step turns a relative error e into −1.5·e²; the constant's is 3.5 %.
static const double NEWTON[] = {0.035, 0.0019, 5.4e-6, 4.5e-11, 0};

static void check_inverse(int64_t a, int steps) {
    const struct format f = {.bits = 20, .newton_steps = steps};
    struct rsqrt r = v_rsqrt(a, &f);
    long double exact = 1 / sqrtl((long double)a);
    long double found = ldexpl((long double)r.y, (int)(-30 - r.h));
    double off = (double)(found / exact - 1), bound = NEWTON[steps] + 4 * 0x1p-29;
    if (!(fabs(off) <= bound))
        fail_msg("1/root of %lld by %d steps: relative error %g > %g", (long long)a, steps, off,
                 bound);
    assert_true(r.m >= (1 << 29) - 1 && r.m < INT64_C(1) << 31 && r.h >= 0 && r.h <= 31);
    long double again = ldexpl((long double)r.m, (int)(2 * r.h - 29));
    if (!(fabsl(again - (long double)a) <= ldexpl(1, (int)(2 * r.h > 29 ? 2 * r.h - 29 : 0))))
        fail_msg("%lld as a mantissa is %Lg", (long long)a, again);
}

TEST(inverse_roots_over_the_whole_range) {
    for (int steps = 1; steps <= 4; steps++) {
        for (int64_t a = 1; a < 3000; a++)
            check_inverse(a, steps);
        for (int e = 0; e < 62; e++) // about every power of two, where exponents change
            for (int64_t k = -2; k <= 2; k++)
                if ((INT64_C(1) << e) + k > 0)
                    check_inverse((INT64_C(1) << e) + k, steps);
        for (int i = 0; i < 100000; i++)
            check_inverse(random_up_to(62), steps);
    }
}

TEST(roots_over_the_whole_range) {
    for (int steps = 1; steps <= 4; steps++)
        for (int bits = 8; bits <= 28; bits++) {
            const struct format f = {.bits = bits, .newton_steps = steps};
            for (int i = 0; i < 5000; i++) {
                int64_t a = random_up_to(62 - bits < 40 ? 62 - bits : 40);
                long double exact = sqrtl(ldexpl((long double)a, bits)),
                            found = (long double)v_root(a, &f);
                long double bound = exact * (NEWTON[steps] + 6 * 0x1p-29) + 1;
                if (!(fabsl(found - exact) <= bound))
                    fail_msg("root of %lld, %d bits, %d steps: %Lg, not %Lg", (long long)a, bits,
                             steps, found, exact);
            }
        }
}

// (1 + m/2)/√(1 + m) and (1.5 + m/2)/√(2 + 2m) for m from 0 to 1 are from 1 to 1.5/√2 = 1.0607.
TEST(the_articles_root) {
    for (int bits = 8; bits <= 20; bits++) {
        const struct format f = {.bits = bits, .sqrt_whole_bits = 23 - bits};
        for (int64_t a = 1; a < 1 << 23; a += 1 + a / 500) {
            double exact = sqrt(ldexp((double)a, -bits)),
                   found = ldexp((double)v_root(a, &f), -bits);
            double below = exact - ldexp(1, -bits), above = exact * 1.0607 + ldexp(1, -bits);
            if (!(found >= below && found <= above))
                fail_msg("root of %lld, %d bits: %g, not %g", (long long)a, bits, found, exact);
        }
    }
}

static struct format article_format(int bits, int wide) {
    int down = bits - (23 - wide);
    double least = fmax(1.25 * fmax(ldexp(1, bits - 31), ldexp(1, -2 * wide)),
                        fmax(ldexp(64, -bits), ldexp(16, wide - 23)));
    return (struct format){.bits = bits,
                           .rsqrt_whole_bits = wide,
                           .rsqrt_shift_right = down > 0 ? down : 0,
                           .rsqrt_shift_left = down < 0 ? -down : 0,
                           .rsqrt_least = (int64_t)ceil(ldexp(least, bits))};
}

// Two steps, and what is cut off in them: a last bit of each of three products, the second times a·y/2 = 1/(2y).
TEST(the_articles_inverse_root) {
    for (int bits = 8; bits <= 22; bits++)
        for (int wide = 5; wide <= 31 - bits; wide++) { // 5: the camera's directions, below 16
            const struct format f = article_format(bits, wide);
            for (int64_t a = f.rsqrt_least; a < INT64_C(1) << (bits + wide); a += 1 + a / 300) {
                double exact = 1 / sqrt(ldexp((double)a, -bits)), last = ldexp(1, -bits);
                double found = ldexp((double)article_rsqrt(a, &f), -bits);
                // a and the estimate are cut to 23 − wide bits, of which two steps leave a fourth power
                double first = 0.035 + ldexp(1, wide - 23) * (1 / exact + 0.5 * exact * exact),
                       e = 1.5 * first * first;
                double bound = 1.5 * e * e * 1.2 * exact + last * (2 + exact + 1 / exact) +
                               exact * 0.6 / (double)a; // of a, the last bit is lost
                if (!(fabs(found - exact) <= bound))
                    fail_msg("1/root of %g, %d bits, %d wide: %g, not %g within %g",
                             ldexp((double)a, -bits), bits, wide, found, exact, bound);
            }
        }
}

TEST(vectors_become_unit) {
    for (int steps = 3; steps <= 4; steps++)
        for (int bits = 8; bits <= 28; bits++) {
            const struct format f = {.bits = bits, .newton_steps = steps};
            for (int i = 0; i < 5000; i++) {
                struct vec v = {random_factor() / 2, random_factor() / 2, random_factor() / 2};
                long double length = sqrtl((long double)v.x * (long double)v.x +
                                           (long double)v.y * (long double)v.y +
                                           (long double)v.z * (long double)v.z);
                if (!(length > 0))
                    continue;
                struct reciprocal length_inverse;
                struct vec unit = normalize(v, &f, &length_inverse);
                const vnum found[] = {unit.x, unit.y, unit.z}, of[] = {v.x, v.y, v.z};
                for (int k = 0; k < 3; k++) {
                    long double exact = ldexpl((long double)of[k] / length, bits);
                    if (!(fabsl((long double)found[k] - exact) <= 1 + ldexpl(2e-8L, bits)))
                        fail_msg("%lld of %Lg, %d bits: %lld, not %Lg", (long long)of[k], length,
                                 bits, (long long)found[k], exact);
                }
                long double inverse = ldexpl(1 / length, bits + (int)length_inverse.fraction);
                if (!(length_inverse.fraction >= 0 && length_inverse.factor < INT64_C(1) << 31 &&
                      fabsl((long double)length_inverse.factor - inverse) <= 1 + 2e-8L * inverse))
                    fail_msg("1/%Lg, %d bits: %lld with %lld", length, bits,
                             (long long)length_inverse.factor, (long long)length_inverse.fraction);
            }
            struct reciprocal length_inverse;
            struct vec nothing = normalize((struct vec){0, 0, 0}, &f, &length_inverse);
            assert_true(nothing.x == 0 && nothing.y == 0 && nothing.z == 0);
        }
}

RUN_TESTS(NULL, NULL)
