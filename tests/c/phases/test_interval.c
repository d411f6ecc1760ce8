// flags: -O2 -iquote truth
// Intervals of truth against exact results: of double intervals in quads, where sums and
// products of doubles fit, of quad intervals as sums of doubles without error; random and nasty numbers.
#include "tests/c/testing.h"

#include "truth/number/angles.c"
#include "truth/number/dd.h"

enum { ROUNDS = MANY(200000) };

static uint64_t state = 0x9e3779b97f4a7c15u;

static uint64_t bits(void) { // G. Marsaglia's xorshift
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return state;
}

// Numbers of all magnitudes from 2⁻³⁰ to 2³⁰, with few bits now and then, so that results are exact or halfway.
static double number(void) {
    uint64_t b = bits();
    double x = (double)(int64_t)bits() * 0x1p-63;
    if ((b & 7) == 0)
        x = (double)((int)(b >> 8 & 63) - 32);
    if ((b & 7) == 1)
        x = 1 + (double)(b >> 8 & 3) * 0x1p-52;
    return ldexp(x, (int)(b >> 40 & 63) - 32);
}

static struct ivd interval(void) {
    double x = number(), y = bits() & 1 ? x : number();
    return (struct ivd){x < y ? x : y, x < y ? y : x};
}

// A number of the interval.
static double of(struct ivd a) {
    double x = a.lo + (a.hi - a.lo) * (double)(bits() >> 11) * 0x1p-53;
    return x < a.lo ? a.lo : x > a.hi ? a.hi : x;
}

static bool holds(struct ivd a, quad x) {
    return (quad)a.lo <= x && x <= (quad)a.hi;
}

TEST(test_double) {
    for (int i = 0; i < ROUNDS; i++) {
        struct ivd a = interval(), b = interval();
        double x = of(a), y = of(b);
        // Exact: products have 106 bits; sums of these magnitudes up to 113 or fewer, else next test.
        assert_true(holds(mul_d(a, b), (quad)x * (quad)y));
        assert_true(holds(square_d(a), (quad)x * (quad)x));
        struct dd sum = exact_sum(x, y);
        struct ivd s = add_d(a, b);
        assert_true(s.lo < sum.hi || (s.lo == sum.hi && sum.lo >= 0));
        assert_true(s.hi > sum.hi || (s.hi == sum.hi && sum.lo <= 0));
        struct ivd q = div_d(a, b);
        if (b.lo > 0) // lo ≤ x/y: lo·y ≤ x, exact on both sides
            assert_true((quad)q.lo * (quad)y <= (quad)x && (quad)x <= (quad)q.hi * (quad)y);
        if (a.lo > 0) {
            struct ivd r = sqrt_d(a);
            assert_true((quad)r.lo * (quad)r.lo <= (quad)x && (quad)x <= (quad)r.hi * (quad)r.hi);
        }
    }
}

// Not wider than they must be: a unit or two of the last place for points, nothing for what is exact.
TEST(test_tight) {
    for (int i = 0; i < ROUNDS; i++) {
        double x = number(), y = number();
        if (x == 0 || y == 0)
            continue;
        struct ivd p = mul_d(point_d(x), point_d(y)), s = add_d(point_d(x), point_d(y));
        assert_true(p.hi - p.lo <= 4 * 0x1p-52 * fabs(x * y));
        assert_true(s.hi - s.lo <= 2 * 0x1p-52 * fabs(x + y));
        struct ivq exact = mul_q(point_q(x), point_q(y));
        assert_true(exact.lo == exact.hi);
    }
    assert_true(is_point_d(add_d(point_d(0.5), point_d(0.25)), 0.75));
    assert_true(is_point_d(mul_d(point_d(0), point_d(3)), 0));
}

// The exact sum of quads is beyond any type at hand: (a + b) − a − b in quad intervals must hold 0.
TEST(test_quad) {
    for (int i = 0; i < ROUNDS / 4; i++) {
        quad tail = (quad)number() * (quad)0x1p-60;
        struct ivq a = {(quad)number() + tail, 0}, b = {(quad)number() * (quad)number(), 0};
        a.hi = a.lo;
        b.hi = b.lo;
        struct ivq zero = sub_q(sub_q(add_q(a, b), a), b);
        assert_true(zero.lo <= 0 && zero.hi >= 0);
        if (a.lo <= 0 || b.lo == 0)
            continue;
        // From outside: a root's square and a quotient's product enclose what they came from.
        struct ivq back = mul_q(div_q(a, b), b), square = square_q(sqrt_q(a));
        assert_true(back.lo <= a.lo && a.hi <= back.hi &&
                    back.hi - back.lo <= a.hi * (quad)0x1p-108);
        assert_true(square.lo <= a.lo && a.hi <= square.hi);
        assert_true(square.hi - square.lo <= a.hi * (quad)0x1p-108);
        assert_true(narrow(a).lo <= a.lo && a.hi <= narrow(a).hi);
    }
}

// A quad sum against error-free parts: x + y + z with x ≫ y ≫ z, known as three doubles.
TEST(test_quad_sum) {
    for (int i = 0; i < ROUNDS / 4; i++) {
        double x = ldexp(1 + (double)(bits() >> 12) * 0x1p-52, 0);
        double y = ldexp(number(), -80), z = ldexp(number(), -160);
        struct ivq sum = add_q(add_q(point_q(x), point_q(y)), point_q(z));
        // (sum − x) is exact (Sterbenz), and holds y + z; z's sign says on which side of y.
        quad low = sum.lo - (quad)x - (quad)y, high = sum.hi - (quad)x - (quad)y;
        assert_true(low <= (quad)z && (quad)z <= high);
    }
}

TEST(test_angles) {
    // s² + c² = 1, sin 30° = 1/2, quarter turns exact; addition against the same angle elsewhere.
    for (int i = 0; i < MANY(20000); i++) {
        double degrees = ldexp(number(), -20);
        struct ivq s, c, s2, c2;
        sine_cosine_q(degrees, &s, &c);
        struct ivq one = add_q(square_q(s), square_q(c));
        assert_true(one.lo <= 1 && one.hi >= 1 && one.hi - one.lo < (quad)0x1p-100);
        assert_true(fabs((double)mid_q(s) - sin(fmod(degrees, 360) * (M_PI / 180))) < 1e-14);
        assert_true(fabs((double)mid_q(c) - cos(fmod(degrees, 360) * (M_PI / 180))) < 1e-14);
        sine_cosine_q(-degrees, &s2, &c2);
        assert_true(s2.lo == -s.hi && c2.lo == c.lo);
    }
    struct ivq s, c;
    sine_cosine_q(30, &s, &c);
    assert_true(s.lo <= (quad)0.5 && s.hi >= (quad)0.5 && s.hi - s.lo < (quad)0x1p-105);
    sine_cosine_q(45, &s, &c);
    assert_true(square_q(s).lo <= (quad)0.5 && square_q(s).hi >= (quad)0.5);
    const double quarter[5][2] = {{0, 1}, {1, 0}, {0, -1}, {-1, 0}, {0, 1}};
    for (int i = 0; i < 5; i++) {
        sine_cosine_q(90.0 * i, &s, &c);
        assert_true(is_point_q(s, quarter[i][0]) && is_point_q(c, quarter[i][1]));
    }
    // sin 1° = 0.01745240643728351281941897851631619…: an exact rational multiple of none of ours.
    sine_cosine_q(1, &s, &c);
    quad known = (quad)1745240643728351281 * (quad)1e16 + (quad)9418978516316192;
    quad unit = (quad)1e16 * (quad)1e20; // 10³⁶: exact in quad? 5³⁶ has 84 bits
    assert_true(s.lo <= (known + 1) / unit * (1 + (quad)0x1p-110));
    assert_true(s.hi >= (known - 1) / unit * (1 - (quad)0x1p-110));
}

TEST(test_special) {
    struct ivd all = div_d(point_d(1), (struct ivd){-1, 1});
    assert_true(all.lo == -INFINITY && all.hi == INFINITY);
    struct ivd tiny = mul_d(point_d(0x1p-600), point_d(0x1p-600)); // below the smallest number
    assert_true(tiny.lo <= 0 && tiny.hi > 0);
    struct ivd nothing = {NAN, NAN};
    assert_int_equal(sign_d(nothing), 0);
    assert_true(has_zero_d(nothing));
    assert_true(sqrt_d((struct ivd){-1, 4}).lo == 0 && sqrt_d((struct ivd){-1, 4}).hi >= 2);
}

RUN_TESTS(NULL, NULL)
