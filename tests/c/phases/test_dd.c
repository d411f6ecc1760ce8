// flags: -O2 -iquote truth
// Double-doubles of truth (shadow estimator, Mandelbulb) against __float128, which has nine bits
// more: sums, products and quotients directly, roots by their squares, logarithms by Taylor's series.
#include "tests/c/testing.h"

#include "truth/number/dd.h"

enum { ROUNDS = 200000 };

static uint64_t state = 0x2545f4914f6cdd1du;

static uint64_t bits(void) { // G. Marsaglia's xorshift
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return state;
}

// Of magnitudes from 2⁻²⁰ to 2²⁰ and of 106 bits, which a __float128 holds.
static struct dd number(void) {
    int64_t high = (int64_t)bits() >> 11, low = (int64_t)bits() >> 12; // within 2⁵² and 2⁵¹
    int power = (int)(bits() % 41) - 20;
    return quick_sum(ldexp((double)high, power - 52), ldexp((double)low, power - 105));
}

static __float128 quad(struct dd a) {
    return (__float128)a.hi + a.lo;
}

// Within 2^-power of `known`, and with parts that do not overlap.
static bool near(struct dd found, __float128 known, int power) {
    __float128 off = quad(found) - known, size = known < 0 ? -known : known;
    return (off < 0 ? -off : off) <= size * (__float128)ldexp(1, -power) &&
           found.hi + found.lo == found.hi;
}

TEST(test_arithmetic) {
    for (int i = 0; i < ROUNDS; i++) {
        struct dd a = number(), b = number();
        __float128 x = quad(a), y = quad(b);
        assert_true(near(dd_add(a, b), x + y, 102));
        assert_true(near(dd_sub(a, b), x - y, 102));
        assert_true(near(dd_mul(a, b), x * y, 101));
        assert_true(near(dd_sqr(a), x * x, 101));
        assert_true(near(dd_scale(a, b.hi), x * b.hi, 101));
        assert_true(near(dd_twofold(a, 0.25), x / 4, 112));
        assert_true(near(dd_from_quad(x + y), x + y, 105));
        if (b.hi != 0)
            assert_true(near(dd_div(a, b), x / y, 100));
        if (a.hi > 0) {
            __float128 root = quad(dd_sqrt(a));
            assert_true(near((struct dd){a.hi, a.lo}, root * root, 99));
        }
    }
}

// What cancels: the low parts are all that is left, and exactly.
TEST(test_cancellation) {
    for (int i = 0; i < ROUNDS; i++) {
        struct dd a = number(), b = {a.hi, a.lo * 0.75};
        assert_true(quad(dd_sub(a, b)) == (__float128)a.lo - b.lo);
        struct dd sum = exact_sum(a.hi, b.lo), product = exact_product(a.hi, b.lo);
        assert_true(quad(sum) == (__float128)a.hi + b.lo);
        assert_true(quad(product) == (__float128)a.hi * b.lo);
    }
}

// Sums whose leading 20 to 51 bits cancel, and whose low parts do not fit one double: what is left is
// known to its own last bits, and fits a __float128.
TEST(test_cancelled_sum) {
    for (int i = 0; i < ROUNDS; i++) {
        double hi = 1 + (double)(bits() >> 12) * 0x1p-52,
               part = ldexp(1, -(int)(20 + (bits() & 31)));
        struct dd a = quick_sum(hi, (double)((int64_t)bits() >> 12) * 0x1p-105);
        struct dd b = quick_sum(-hi * (1 + part), (double)((int64_t)bits() >> 12) * 0x1p-110);
        assert_true(near(dd_add(a, b), quad(a) + quad(b), 102));
    }
}

TEST(test_order) {
    struct dd one = dd_from(1), above = {1, 0x1p-80}, below = {1, -0x1p-80};
    assert_true(dd_less(below, one) && dd_less(one, above) && !dd_less(one, one));
    assert_true(dd_min(above, below).lo == below.lo && dd_min(below, above).lo == below.lo);
    assert_true(dd_max(above, below).lo == above.lo && dd_max(below, above).lo == above.lo);
    assert_true(dd_abs(dd_neg(above)).lo == above.lo && dd_abs((struct dd){0, -1}).lo == 1);
    assert_true(quad(dd_floor(below)) == 0 && quad(dd_floor(above)) == 1);
    assert_true(quad(dd_floor(dd_from(-2.5))) == -3);
}

// e^x by Taylor's series of x/2¹⁰, squared ten times: 2⁻¹⁰³ after that.
static __float128 exponential(__float128 x) {
    if (x < 0)
        return 1 / exponential(-x);
    __float128 small = x / 1024, term = 1, sum = 0; // e^small − 1
    for (int k = 1; k < 24; k++) {
        term = term * small / k;
        sum += term;
    }
    for (int i = 0; i < 10; i++)
        sum = sum * (sum + 2); // (1 + s)² − 1
    return sum + 1;
}

TEST(test_logarithm) {
    for (int i = 0; i < 2000; i++) {
        struct dd a = dd_abs(number());
        if (a.hi != 0)
            assert_true(near(a, exponential(quad(dd_log(a))), 98));
    }
    assert_true(quad(dd_log(dd_from(1))) == 0);
}

RUN_TESTS(NULL, NULL)
