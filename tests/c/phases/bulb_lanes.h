// A Mandelbulb's operations of opt9_convex (opt10_scene has the same files) against doubles: test_bulb_8.c and
// test_bulb_16.c, each for one number of lanes.
#include "tests/c/testing.h"

#pragma GCC diagnostic ignored "-Wunused-function" // of what is included
#include "bulb/bulb_chebyshev.c"
#include "bulb/chebyshev_pieces.c"
#include "random_from.h"

enum { ROUNDS = 20000 };

static float some_power(double least, double most) {
    return (float)pow(10.0, random_from(least, most));
}

static void assert_near(double found, double expected, double most) {
    if (!(fabs(found - expected) <= most))
        fail_msg("%.9g in place of %.9g, off by %.3g of at most %.3g", found, expected,
                 fabs(found - expected), most);
}

// 2^-20: some ulp of a float, where a guess alone has 2^-14 and 2^-11.
TEST(test_roots_and_quotients_are_to_some_ulp) {
    float a[LANES], b[LANES], m[LANES], product[LANES], slope[LANES], found[3][LANES];
    for (int round = 0; round < ROUNDS / LANES; round++) {
        for (int lane = 0; lane < LANES; lane++) {
            a[lane] = some_power(-30, 37);
            b[lane] = some_power(-18, 18) * (lane % 2 ? -1.0f : 1.0f);
            // As the estimate has them, up to a bailout of 10,000: |w|² and the product of all before, the derivative.
            m[lane] = some_power(-6, 33);
            product[lane] = some_power(-6, 4);
            slope[lane] = some_power(0, 24);
        }
        struct rooted rho = rooted(v_load(a));
        v_store(twice_root_times(&rho, v_load(b)), found[0]);
        v_store(divided_by(v_load(b), &rho), found[1]);
        v_store(twice_over_root(v_load(m), v_load(m) * v_load(product), v_load(slope)), found[2]);
        for (int lane = 0; lane < LANES; lane++) {
            double twice = 2.0 * b[lane] * sqrt(a[lane]), over = (double)b[lane] / a[lane];
            double all = (double)(m[lane] * product[lane]),
                   both = 2.0 * m[lane] / (sqrt(all) * slope[lane]);
            assert_near(found[0][lane], twice, 0x1p-20 * fabs(twice));
            if (fabs(over) > 1e-36 && fabs(over) < 1e38)
                assert_near(found[1][lane], over, 0x1p-20 * fabs(over));
            if (both > 1e-36)
                assert_near(found[2][lane], both, 0x1p-20 * both);
        }
    }
}

// The map of baseline's sdf_mandelbulb, once: w becomes w⁸ + p.
static void map(double w[3], const double p[3]) {
    double x = w[0], y = w[1], z = w[2], x2 = x * x, y2 = y * y, z2 = z * z, k3 = x2 + z2;
    double k2 = k3 > 0 ? 1 / sqrt(pow(k3, 7)) : 0, k4 = x2 - y2 + z2;
    double k1 = x2 * x2 + y2 * y2 + z2 * z2 - 6 * y2 * z2 - 6 * x2 * y2 + 2 * z2 * x2;
    w[0] = p[0] + 64 * x * y * z * (x2 - z2) * k4 * (x2 * x2 - 6 * x2 * z2 + z2 * z2) * k1 * k2;
    w[1] = p[1] - 16 * y2 * k3 * k4 * k4 + k1 * k1;
    w[2] = p[2] - 8 * y * k4 *
                      (x2 * x2 * x2 * x2 - 28 * x2 * x2 * x2 * z2 + 70 * x2 * x2 * z2 * z2 -
                       28 * x2 * z2 * z2 * z2 + z2 * z2 * z2 * z2) *
                      k1 * k2;
}

// Its estimate; NaN where a float may escape an iteration sooner or later.
static double estimate(const double p[3], double bailout) {
    double w[3] = {p[0], p[1], p[2]}, m = p[0] * p[0] + p[1] * p[1] + p[2] * p[2], slope = 1.5;
    for (int i = 0; i < 4; i++) {
        slope = 8 * pow(m, 3.5) * slope + 1;
        map(w, p);
        m = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
        if (fabs(m - bailout) < 1e-2 * bailout)
            return NAN;
        if (m > bailout)
            break;
    }
    return m > 0 ? 0.25 * log(m) * sqrt(m) / slope : 0;
}

static void random_point(int which, float p[3]) {
    double far = which % 4 ? random_from(0.3, 1.3) : random_from(1, 8), square = 0, way[3];
    for (int i = 0; i < 3; i++) {
        way[i] = random_from(-1, 1);
        square += way[i] * way[i];
    }
    for (int i = 0; i < 3; i++)
        p[i] = (float)(far * way[i] / sqrt(square));
    if (which % 16 == 1)
        p[2] = which % 32 == 1 ? 0.0f : -0.0f;
    if (which % 16 == 2) { // on the axis, not at the centre: nearer than 1e-3 the estimate is 0
        p[0] = p[2] = 0.0f;
        p[1] = (float)(which % 32 == 2 ? far : -far);
    }
    if (which % 64 == 3)
        p[0] = p[1] = p[2] = 0.0f;
}

// A float's rounding of the point and of the first iteration moves the surface by some 1e-7 of the point; the
// derivative's small summand has 14 and 11 bits.
TEST(test_the_estimate_is_the_map_of_baseline) {
    static const float bailouts[] = {256.0f, 10000.0f};
    const double rough = LANES == 16 ? 0x1p-13 : 0x1p-11;
    for (int exact = 0; exact < 2; exact++)
        for (int which = 0; which < 2; which++) {
            struct primitive s = {.iterations = 4, .bailout = bailouts[which]};
            int asked = 0;
            for (int round = 0; round < ROUNDS / LANES / INTERLEAVED; round++) {
                float at[INTERLEAVED][3][LANES], found[LANES];
                struct vec p[INTERLEAVED];
                vmask done[INTERLEAVED];
                vfloat h[INTERLEAVED];
                for (int k = 0; k < INTERLEAVED; k++) {
                    for (int lane = 0; lane < LANES; lane++) {
                        float point[3];
                        random_point((round * INTERLEAVED + k) * LANES + lane, point);
                        for (int i = 0; i < 3; i++)
                            at[k][i][lane] = point[i];
                    }
                    p[k] = (struct vec){v_load(at[k][0]), v_load(at[k][1]), v_load(at[k][2])};
                    done[k] = v_mask_none();
                }
                bulbs(&s, p, done, false, exact, h);
                for (int k = 0; k < INTERLEAVED; k++) {
                    v_store(h[k], found);
                    for (int lane = 0; lane < LANES; lane++) {
                        double point[3] = {at[k][0][lane], at[k][1][lane], at[k][2][lane]};
                        double expected = estimate(point, (double)bailouts[which]);
                        if (isnan(expected))
                            continue;
                        asked++;
                        assert_near(found[lane], expected, 1e-6 + rough * fabs(expected));
                    }
                }
            }
            assert_true(asked > ROUNDS * 9 / 10);
        }
}

// The first iteration on a piece of a ray: chebyshev_orbit() from the polynomials of store_pieces().
TEST(test_pieces_are_the_first_iteration) {
    for (int round = 0; round < 400; round++) {
        struct ray_pieces pieces;
        struct chebyshev_lanes lanes;
        float middle[3][LANES], way[3][LANES], end[LANES], per[LANES], t[LANES];
        for (int lane = 0; lane < LANES; lane++) {
            double square = 0;
            do { // not so near to the axis that a piece is longer than its share
                for (int i = 0; i < 3; i++)
                    middle[i][lane] = (float)random_from(-0.7, 0.7);
            } while (hypot(middle[0][lane], middle[2][lane]) < 1e-3);
            for (int i = 0; i < 3; i++) {
                way[i][lane] = (float)random_from(-1, 1);
                square += (double)way[i][lane] * way[i][lane];
            }
            for (int i = 0; i < 3; i++)
                way[i][lane] = (float)(way[i][lane] / sqrt(square));
            double rho = hypot(middle[0][lane], middle[2][lane]) /
                         1.04; // where the piece begins it may be less
            end[lane] = fminf((float)rho * CLOSE_PIECE_SHARE, CLOSE_PIECE);
            per[lane] = 1.0f / end[lane];
            t[lane] = end[lane] * (float)random_from(-1, 1);
        }
        vfloat zero = v_splat(0.0f);
        struct vec_double o = {v_double_sum(v_load(middle[0]), zero),
                               v_double_sum(v_load(middle[1]), zero),
                               v_double_sum(v_load(middle[2]), zero)};
        struct vec_double d = {v_double_sum(v_load(way[0]), zero),
                               v_double_sum(v_load(way[1]), zero),
                               v_double_sum(v_load(way[2]), zero)};
        store_pieces(o, d, v_double_sum(zero, zero), v_load(end), v_load(per), &pieces);
        for (int i = 0; i < N_PLACE; i++)
            lanes.field[i] = v_load(pieces.field[i]);
        struct scaled_orbit told = chebyshev_orbit(&lanes, v_load(t), v_mask_none());
        float found[4][LANES];
        v_store(told.x, found[0]);
        v_store(told.y, found[1]);
        v_store(told.z, found[2]);
        v_store(told.slope, found[3]);
        for (int lane = 0; lane < LANES; lane++) {
            double p[3], w[3], square = 0;
            for (int i = 0; i < 3; i++) {
                w[i] = p[i] = middle[i][lane] + (double)way[i][lane] * (double)t[lane];
                square += p[i] * p[i];
            }
            double slope = 12 * pow(square, 3.5) + 1;
            map(w, p);
            for (int i = 0; i < 3;
                 i++) // a float's rounding of each term, and what the polynomial leaves
                assert_near(found[i][lane], w[i], 0x1p-22 * fmax(1, fabs(w[i])));
            assert_near(found[3][lane], slope, 0x1p-19 * slope);
        }
    }
}

RUN_TESTS(NULL, NULL)
