// flags: -O2 -iquote truth
// Double-doubles of truth (shadow estimator, Mandelbulb) against quad, which has nine bits
// more: sums, products and quotients directly, roots by their squares, logarithms by Taylor's series.
#include "tests/c/testing.h"

#include "truth/number/dd.h"

enum { ROUNDS = MANY(200000) };

static uint64_t state = 0x2545f4914f6cdd1du;

static uint64_t bits(void) { // G. Marsaglia's xorshift
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return state;
}

// A number of magnitude 2⁻²⁰ to 2²⁰ and of 106 bits, which a quad holds.
static struct dd number(void) {
    int64_t high = (int64_t)bits() >> 11, low = (int64_t)bits() >> 12; // within 2⁵² and 2⁵¹
    int power = (int)(bits() % 41) - 20;
    return quick_sum(ldexp((double)high, power - 52), ldexp((double)low, power - 105));
}

static quad whole(struct dd a) {
    return (quad)a.hi + a.lo;
}

// Within 2^-power of `known`, and with parts that do not overlap.
static bool near(struct dd found, quad known, int power) {
    quad off = whole(found) - known, size = known < 0 ? -known : known;
    return (off < 0 ? -off : off) <= size * (quad)ldexp(1, -power) &&
           found.hi + found.lo == found.hi;
}

TEST(test_arithmetic) {
    for (int i = 0; i < ROUNDS; i++) {
        struct dd a = number(), b = number();
        quad x = whole(a), y = whole(b);
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
            quad root = whole(dd_sqrt(a));
            assert_true(near((struct dd){a.hi, a.lo}, root * root, 99));
        }
    }
}

// What cancels: the low parts are all that is left, and exactly.
TEST(test_cancellation) {
    for (int i = 0; i < ROUNDS; i++) {
        struct dd a = number(), b = {a.hi, a.lo * 0.75};
        assert_true(whole(dd_sub(a, b)) == (quad)a.lo - b.lo);
        struct dd sum = exact_sum(a.hi, b.lo), product = exact_product(a.hi, b.lo);
        assert_true(whole(sum) == (quad)a.hi + b.lo);
        assert_true(whole(product) == (quad)a.hi * b.lo);
    }
}

// Sums whose leading 20 to 51 bits cancel, and whose low parts do not fit one double: what is left is
// known to its own last bits, and fits a quad.
TEST(test_cancelled_sum) {
    for (int i = 0; i < ROUNDS; i++) {
        double hi = 1 + (double)(bits() >> 12) * 0x1p-52,
               part = ldexp(1, -(int)(20 + (bits() & 31)));
        struct dd a = quick_sum(hi, (double)((int64_t)bits() >> 12) * 0x1p-105);
        struct dd b = quick_sum(-hi * (1 + part), (double)((int64_t)bits() >> 12) * 0x1p-110);
        assert_true(near(dd_add(a, b), whole(a) + whole(b), 102));
    }
}

TEST(test_order) {
    struct dd one = dd_from(1), above = {1, 0x1p-80}, below = {1, -0x1p-80};
    assert_true(dd_less(below, one) && dd_less(one, above) && !dd_less(one, one));
    assert_true(dd_min(above, below).lo == below.lo && dd_min(below, above).lo == below.lo);
    assert_true(dd_max(above, below).lo == above.lo && dd_max(below, above).lo == above.lo);
    assert_true(dd_abs(dd_neg(above)).lo == above.lo && dd_abs((struct dd){0, -1}).lo == 1);
    assert_true(whole(dd_floor(below)) == 0 && whole(dd_floor(above)) == 1);
    assert_true(whole(dd_floor(dd_from(-2.5))) == -3);
}

// e^x by Taylor's series of x/2¹⁰, squared ten times: 2⁻¹⁰³ after that.
static quad exponential(quad x) {
    if (x < 0)
        return 1 / exponential(-x);
    quad small = x / 1024, term = 1, sum = 0; // e^small − 1
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
            assert_true(near(a, exponential(whole(dd_log(a))), 98));
    }
    assert_true(whole(dd_log(dd_from(1))) == 0);
}

RUN_TESTS(NULL, NULL)
