// flags: -O2 -ffp-contract=off -Icommon -iquote truth
// Balls under the Mandelbulb's map (truth) against points: of each ball points are drawn, and mapped in quads by the
// formula of sdf.c, which shares nothing with the one in ball_body.h.
#include "tests/c/testing.h"

#include "tests/c/phases/random_from.h"
#include "truth/bulb/bulb_hit.c"

enum { ROUNDS = MANY(40000), POINTS = 6 };

struct dd distance_to(const struct solid *solid, const struct dd p[3]) { // what bulb_hit.c links to
    (void)solid;
    return p[0];
}

// w ← w⁸ + c, by the polynomials of the phases.
static void polynomial(quad w[3], const quad c[3]) {
    quad x = w[0], y = w[1], z = w[2], x2 = x * x, y2 = y * y, z2 = z * z;
    quad x4 = x2 * x2, z4 = z2 * z2, k3 = x2 + z2, k4 = k3 - y2;
    quad k1 = x4 + y2 * y2 + z4 - 6 * y2 * k3 + 2 * x2 * z2;
    quad k7 = k3 * k3 * k3 * k3 * k3 * k3 * k3, k2 = k7 > 0 ? 1 / root_q(k7) : 0;
    quad re = x4 * x4 - 28 * x4 * x2 * z2 + 70 * x4 * z4 - 28 * x2 * z2 * z4 + z4 * z4;
    quad im = 8 * x * z * (x2 - z2) * (x4 - 6 * x2 * z2 + z4);
    w[0] = c[0] + 8 * im * y * k4 * k1 * k2;
    w[1] = c[1] + k1 * k1 - 16 * y2 * k3 * k4 * k4;
    w[2] = c[2] - 8 * re * y * k4 * k1 * k2;
}

static void direction(double v[3]) {
    double square;
    do {
        for (int i = 0; i < 3; i++)
            v[i] = random_from(-1, 1);
        square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    } while (square > 1 || square < 1e-3);
    for (int i = 0; i < 3; i++)
        v[i] /= sqrt(square);
}

// A point of length up to `most`; one in eight is near the polar axis, where the map is steepest.
static void centre(double most, double c[3]) {
    double length = random_from(0.1, most);
    direction(c);
    if (random_from(0, 8) < 1) {
        c[0] *= 1e-3;
        c[2] *= 1e-3;
        c[1] = c[1] < 0 ? -1 : 1;
    }
    for (int i = 0; i < 3; i++)
        c[i] *= length;
}

// A point of the ball, half of the time on its surface.
static void point_of(const double c[3], double e, quad p[3]) {
    double v[3], at = e * fmin(random_from(0, 2), 0.999999);
    direction(v);
    for (int i = 0; i < 3; i++)
        p[i] = (quad)c[i] + (quad)(at * v[i]);
}

TEST(test_stretch) {
    static const quad zero[3] = {0, 0, 0};
    int steep = 0;
    for (int i = 0; i < ROUNDS; i++) {
        double c[3], e = pow(10, random_from(-6, -0.3));
        centre(1.4, c);
        double r = length_d(c), most = stretch_d(c, r, e);
        quad p[3], q[3], apart[3], gone[3];
        point_of(c, e, p);
        point_of(c, e, q);
        for (int k = 0; k < 3; k++)
            apart[k] = p[k] - q[k];
        polynomial(p, zero);
        polynomial(q, zero);
        for (int k = 0; k < 3; k++)
            gone[k] = p[k] - q[k];
        double ratio = (double)(length_q(gone) / length_q(apart));
        assert_true(ratio <= most * (1 + 1e-9));
        steep += e < 1e-3 && ratio > 1.5 * 8 * pow(r, 7);
    }
    assert_true(steep > ROUNDS / 100); // 8r⁷ alone is no bound
}

TEST(test_side) {
    int decided[3] = {0, 0, 0};
    for (int i = 0; i < ROUNDS; i++) {
        int iterations = 1 + i % 5;
        double c[3], e = i % 7 ? pow(10, random_from(-9, -1)) : 0;
        centre(1.3, c);
        quad exact[3] = {c[0], c[1], c[2]};
        int side = ball_side_d(iterations, c, e), fine = ball_side_q(iterations, exact, e);
        assert_true(side == 0 || fine == 0 || side == fine);
        decided[side + 1]++;
        for (int k = 0; k < POINTS && side != 0; k++) {
            quad p[3];
            point_of(c, e, p);
            quad w[3] = {p[0], p[1], p[2]};
            for (int n = 0; n < iterations && length_q(w) < 16; n++)
                polynomial(w, p);
            assert_int_equal(length_q(w) > 1 ? 1 : -1, side);
        }
    }
    assert_true(decided[0] > ROUNDS / 10 && decided[2] > ROUNDS / 10);
    assert_true(decided[1] < ROUNDS / 2);
}

// A copy is where its cell is, a ball across the wall is in two copies, and one larger than the cell is undecided.
TEST(test_copies) {
    struct shape shape = {.type = SHAPE_MANDELBULB, .repeat = {1.5, 0, 0}};
    shape.mandelbulb.iterations = 4;
    static const double at[][3] = {
        {0.02, 0.1, 0.1}, {0, 1.2, 0}, {0.7499, 0.1, 0.1}, {0.7499, 0.9, 0.9}};
    for (size_t i = 0; i < LENGTH(at); i++)
        for (int k = -3; k <= 3; k++) {
            double moved[3] = {at[i][0] + 1.5 * k, at[i][1], at[i][2]};
            int side = ball_side_d(4, at[i], 1e-3);
            assert_int_not_equal(side, 0);
            assert_int_equal(shape_side_d(&shape, moved, 1e-3, 0), side);
        }
    assert_int_equal(shape_side_d(&shape, at[1], 0.8, 0), 0);
    shape.repeat[0] = 0;
    shape.repeat[2] = 1.8; // the bulb is no mirror image of itself along z
    int differ = 0;
    for (int i = 0; i < 2000; i++) {
        double wall[3] = {random_from(-0.8, 0.8), random_from(-0.8, 0.8), 0.8999}, other[3];
        for (int k = 0; k < 3; k++)
            other[k] = wall[k] - 1.8 * (k == 2);
        int one = ball_side_d(4, wall, 1e-3), two = ball_side_d(4, other, 1e-3);
        assert_int_equal(shape_side_d(&shape, wall, 1e-3, 0), one == two ? one : 0);
        differ += one * two < 0;
    }
    assert_true(differ > 10);
}

RUN_TESTS(NULL, NULL)
