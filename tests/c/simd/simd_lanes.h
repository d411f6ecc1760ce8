// common/simd against scalar arithmetic, with NaN, infinities, zeros of both signs and denormals in the lanes:
// test_simd_4.c, test_simd_8.c and test_simd_16.c, each for one number of lanes.
#include "tests/c/testing.h"

#include <stdio.h>
#include <string.h>

#pragma GCC diagnostic ignored "-Wunused-function" // of what is included
#include "simd/simd.h"

static const float values[] = {0.0f,   -0.0f,   1.0f,  -1.0f,  2.5f,      -2.5f,     3.5f,
                               1e-40f, -1e-40f, 1e30f, -1e30f, INFINITY,  -INFINITY, NAN,
                               -NAN,   0.3f,    7.25f, -7.75f, 0x1p-126f, 123456.7f};
#ifdef __x86_64__
enum { BY_SSE2 = LANES == 4 };
#else
enum { BY_SSE2 = 0 };
#endif
enum { VALUES = sizeof values / sizeof *values, PAIRS = VALUES * VALUES };

static uint32_t bits_of(float a) {
    uint32_t bits;
    memcpy(&bits, &a, sizeof bits);
    return bits;
}

static void assert_bits(const char *what, float found, float expected, float a, float b) {
    if (isnan(expected) ? !isnan(found) : bits_of(found) != bits_of(expected))
        fail_msg("%s(%g, %g) is %g in place of %g", what, (double)a, (double)b, (double)found,
                 (double)expected);
}

// Every pair of values, LANES pairs at a time.
static void pairs(int first, float a[LANES], float b[LANES]) {
    for (int lane = 0; lane < LANES; lane++) {
        int pair = (first + lane) % PAIRS;
        a[lane] = values[pair / VALUES];
        b[lane] = values[pair % VALUES];
    }
}

static vmask some_lanes(int seed) {
    return v_mask_of_bits((unsigned)(seed * 2654435761u >> 7) & ((1u << LANES) - 1));
}

static void assert_mask(const char *what, vmask found, const bool expected[LANES], const float *a,
                        const float *b) {
    for (int lane = 0; lane < LANES; lane++)
        if ((v_mask_bits(found) >> lane & 1) != expected[lane])
            fail_msg("%s(%g, %g) is %d", what, (double)a[lane], (double)b[lane], !expected[lane]);
}

// Ordered comparisons are false of a NaN, unordered ones true: each by its name, with a mask and without.
TEST(test_comparisons) {
    for (int first = 0; first < PAIRS; first += LANES) {
        float a[LANES], b[LANES];
        pairs(first, a, b);
        vfloat va = v_load(a), vb = v_load(b);
        vmask in = some_lanes(first + 1);
        bool expected[LANES], within[LANES];
#define COMPARE(name, scalar)                                                                      \
    for (int lane = 0; lane < LANES; lane++)                                                       \
        expected[lane] = (scalar);                                                                 \
    assert_mask("v_cmp_" #name, v_cmp_##name(va, vb), expected, a, b);
#define COMPARE_IN(name, scalar)                                                                   \
    COMPARE(name, scalar)                                                                          \
    for (int lane = 0; lane < LANES; lane++)                                                       \
        within[lane] = expected[lane] && v_mask_bits(in) >> lane & 1;                              \
    assert_mask("v_cmp_" #name "_in", v_cmp_##name##_in(in, va, vb), within, a, b);
        COMPARE(eq, a[lane] == b[lane])
        COMPARE(le, a[lane] <= b[lane])
        COMPARE_IN(lt, a[lane] < b[lane])
        COMPARE_IN(gt, a[lane] > b[lane])
        COMPARE_IN(ge, a[lane] >= b[lane])
        COMPARE_IN(nlt, !(a[lane] < b[lane]))
        COMPARE_IN(ngt, !(a[lane] > b[lane]))
        COMPARE_IN(nge, !(a[lane] >= b[lane]))
        for (int lane = 0; lane < LANES; lane++)
            expected[lane] = signbit(a[lane]);
        assert_mask("v_signbit", v_signbit(va), expected, a, b);
    }
}

static float magnitude(float a, uint32_t sign) {
    uint32_t bits = (bits_of(a) & 0x7fffffff) | sign;
    memcpy(&a, &bits, sizeof a);
    return a;
}

static float fused(float a, float b, float c) {
    return BY_SSE2 ? a * b + c : fmaf(a, b, c);
}

TEST(test_arithmetic) {
    for (int first = 0; first < PAIRS; first += LANES) {
        float a[LANES], b[LANES], found[LANES];
        pairs(first, a, b);
        vfloat va = v_load(a), vb = v_load(b), vc = v_splat(0.75f);
#define ARITHMETIC(name, vector, scalar)                                                           \
    v_store(vector, found);                                                                        \
    for (int lane = 0; lane < LANES; lane++)                                                       \
        assert_bits(name, found[lane], scalar, a[lane], b[lane]);
        ARITHMETIC("v_min", v_min(va, vb), a[lane] < b[lane] ? a[lane] : b[lane])
        ARITHMETIC("v_max", v_max(va, vb), a[lane] > b[lane] ? a[lane] : b[lane])
        ARITHMETIC("v_abs", v_abs(va), magnitude(a[lane], 0))
        ARITHMETIC("v_copysign", v_copysign(va, vb),
                   magnitude(a[lane], bits_of(b[lane]) & 0x80000000))
        ARITHMETIC("v_sqrt", v_sqrt(va), sqrtf(a[lane]))
        ARITHMETIC("v_madd", v_madd(va, vb, vc), fused(a[lane], b[lane], 0.75f))
        ARITHMETIC("v_nmadd", v_nmadd(va, vb, vc), fused(-a[lane], b[lane], 0.75f))
        ARITHMETIC("v_msub", v_msub(va, vb, vc), fused(a[lane], b[lane], -0.75f))
        for (int lane = 0; lane < LANES; lane++) // what SSE2 rounds by way of whole numbers
            if (BY_SSE2 && !(fabsf(a[lane]) < 0x1p31f))
                a[lane] = 4.5f;
        va = v_load(a);
        v_store(v_floor(va), found);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(isnan(a[lane]) ? isnan(found[lane]) : found[lane] == floorf(a[lane]));
        v_store(v_round(va), found);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(isnan(a[lane]) ? isnan(found[lane]) : found[lane] == rintf(a[lane]));
    }
}

TEST(test_masks) {
    const unsigned all = (1u << LANES) - 1;
    float a[LANES], b[LANES], found[LANES];
    assert_int_equal(v_mask_bits(v_mask_none()), 0);
    assert_int_equal(v_mask_bits(v_mask_all()), all);
    for (int count = 0; count <= LANES; count++)
        assert_int_equal(v_mask_bits(v_mask_first(count)), (1u << count) - 1);
    for (int round = 0; round < 500; round++) {
        pairs(round, a, b);
        vmask m = some_lanes(round), n = some_lanes(round + 1000);
        unsigned mb = v_mask_bits(m), nb = v_mask_bits(n);
        vfloat va = v_load(a), vb = v_load(b);
        assert_int_equal(v_mask_bits(v_mask_of_bits(mb)), mb);
        assert_int_equal(v_mask_bits(v_and(m, n)), mb & nb);
        assert_int_equal(v_mask_bits(v_or(m, n)), mb | nb);
        assert_int_equal(v_mask_bits(v_andnot(m, n)), ~mb & nb);
        assert_int_equal(v_mask_bits(v_not(m)), ~mb & all);
        assert_int_equal(v_any(m), mb != 0);
        assert_int_equal(v_all(v_or(m, v_not(m))), 1);
        assert_int_equal(v_same(m, n), mb == nb);
        assert_int_equal(v_count(m), __builtin_popcount(mb));
        assert_int_equal(v_any_of_four(m, v_mask_none(), v_and(m, n), n),
                         (mb != 0) | ((mb & nb) != 0) << 2 | (nb != 0) << 3);
#define CHOSEN(name, vector, yes, no)                                                              \
    v_store(vector, found);                                                                        \
    for (int lane = 0; lane < LANES; lane++)                                                       \
        assert_bits(name, found[lane], mb >> lane & 1 ? (yes) : (no), a[lane], b[lane]);
        CHOSEN("v_select", v_select(m, va, vb), a[lane], b[lane])
        CHOSEN("v_select_or_zero", v_select_or_zero(m, va), a[lane], 0.0f)
        CHOSEN("v_zero_where", v_zero_where(m, va), 0.0f, a[lane])
        CHOSEN("v_negate_where", v_negate_where(m, va), -a[lane], a[lane])
        CHOSEN("v_madd_where", v_madd_where(m, va, vb, v_splat(0.75f)),
               fused(a[lane], b[lane], 0.75f), a[lane])
        v_store(v_add_where(m, va, vb), found);
        for (int lane = 0; lane < LANES; lane++) { // -0 outside of m may become 0
            float expected = mb >> lane & 1 ? a[lane] + b[lane] : a[lane];
            assert_true(isnan(expected) ? isnan(found[lane]) : found[lane] == expected);
        }
    }
}

TEST(test_fields_and_reductions) {
    float a[LANES], found[LANES], exponent[LANES];
    for (int round = 0; round < 2000; round++) {
        float least = INFINITY, most = -INFINITY;
        for (int lane = 0; lane < LANES; lane++) {
            a[lane] = ldexpf(1.0f + (float)((round * 37 + lane * 11) % 1000) / 1000.0f,
                             (round + lane * 5) % 200 - 100);
            least = fminf(least, a[lane]);
            most = fmaxf(most, a[lane]);
        }
        vfloat va = v_load(a), e;
        assert_true(v_reduce_min(va) == least && v_reduce_max(va) == most);
        assert_true(v_lane0(va) == a[0] && v_lane0(v_max_of_lanes(va)) == most);
        v_store(v_exponent(va), exponent);
        v_store(v_mantissa(va), found);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(ldexpf(found[lane], (int)exponent[lane]) == a[lane] && found[lane] >= 1 &&
                        found[lane] < 2);
        v_store(v_ldexp(v_load(found), v_load(exponent)), found);
        assert_memory_equal(found, a, sizeof a);
        v_store(v_mantissa_near_1(va, &e), found);
        v_store(e, exponent);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(ldexpf(found[lane], (int)exponent[lane]) == a[lane] &&
                        found[lane] >= 0.75f && found[lane] < 1.5f);
        v_store(v_pow2_unit(va) * va, found);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(found[lane] >= 1 && found[lane] < 2);
        v_store(v_rsqrt_newton(va), found);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(fabs(found[lane] * sqrt((double)a[lane]) - 1) < 0x1p-20);
        v_store(v_sqrt_below(va), found);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(found[lane] <= sqrt((double)a[lane]) &&
                        found[lane] > sqrt((double)a[lane]) * (1 - 0x1p-10));
        v_store(v_rcp_approx(va) * va, found);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(fabsf(found[lane] - 1) < 0x1p-11f);
        v_store(v_log(va), found);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(fabs(found[lane] - log((double)a[lane])) < 1e-5);
    }
}

TEST(test_compress) {
    float a[LANES], found[LANES + LANES];
    for (int lane = 0; lane < LANES; lane++)
        a[lane] = (float)(lane + 1);
    for (unsigned which = 0; which < 1u << LANES; which += LANES == 16 ? 7 : 1) {
        vmask m = v_mask_of_bits(which);
        v_compress_store(m, v_load(a), found);
        int next = 0;
        for (int lane = 0; lane < LANES; lane++)
            if (which >> lane & 1)
                assert_true(found[next++] == a[lane]);
#if LANES > 4
        float row[LANES], back[LANES];
        memcpy(row, found, sizeof row);
        v_store(v_expand_load(m, v_splat(-1.0f), row), back);
        for (int lane = 0; lane < LANES; lane++)
            assert_true(back[lane] == (which >> lane & 1 ? a[lane] : -1.0f));
        int numbers[LANES];
        v_compress_store_lanes(m, 100, 2, numbers);
        for (int lane = 0, k = 0; lane < LANES; lane++)
            if (which >> lane & 1)
                assert_int_equal(numbers[k++], 100 + 4 * lane);
        vfloat rows[2] = {v_splat(-1.0f), v_splat(-2.0f)};
        float from[2 * LANES];
        for (int i = 0; i < 2 * LANES; i++)
            from[i] = (float)(10 + i);
        v_expand_rows(rows, 2, which, from, LANES);
        for (int i = 0; i < 2; i++)
            for (int lane = 0, k = 0; lane < LANES; lane++)
                assert_true(rows[i][lane] ==
                            (which >> lane & 1 ? from[i * LANES + k++] : -1.0f - (float)i));
#endif
    }
}

#if LANES > 4
TEST(test_points_and_pictures) {
    vfloat error, sum = v_two_sum(v_splat(1.0f), v_splat(0x1p-30f), &error);
    assert_true(v_lane0(sum) == 1.0f && v_lane0(error) == 0x1p-30f);
    vdouble third =
        v_double_sum(v_splat((float)(1.0 / 3)), v_splat((float)(1.0 / 3 - (float)(1.0 / 3))));
    assert_true(fabs(third.low[0] - 1.0 / 3) < 0x1p-48 && fabs(third.high[0] - 1.0 / 3) < 0x1p-48);
    float rgb[4][64] = {{0}};
    vfloat red = v_iota(), green = red + v_splat(100.0f), blue = red + v_splat(200.0f);
    v_store_block(rgb[0], 64, red, green, blue);
    for (int lane = 0; lane < LANES; lane++)
        for (int i = 0; i < 3; i++)
            assert_true(rgb[lane / 4][3 * (lane % 4) + i] == (float)(lane + 100 * i));
    float line[3 * LANES];
    v_store_row(line, false, red, green, blue);
    for (int lane = 0; lane < LANES; lane++)
        for (int i = 0; i < 3; i++)
            assert_true(line[3 * lane + i] == (float)(lane + 100 * i));
}

// To the bit, up to where the sum of the whole exponential is reduced by ln 2.
TEST(test_small_powers) {
    for (float from = -0.346f; from < 0.346f; from += 1e-4f) {
        float found[LANES], whole[LANES];
        vfloat a = v_madd(v_iota(), v_splat(5e-6f), v_splat(from - 5e-6f * LANES));
        a = v_max(a, v_splat(-0.346f));
        v_store(v_exp_near_0(a), found);
        v_store(v_exp(a), whole);
        assert_memory_equal(found, whole, sizeof found);
        assert_true(fabs(found[0] / exp((double)v_lane0(a)) - 1) < 0x1p-22);
    }
}

// Words of integers, floats and places in any order.
TEST(test_lanes_that_move) {
    float a[LANES], found[LANES], to[4 * LANES];
    int numbers[LANES], packed[LANES];
    unsigned short places[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        a[lane] = lane % 3 ? values[lane] : -0.0f;
        numbers[lane] = -1000 * lane - 7;
        places[lane] = (unsigned short)(LANES - 1 - lane + (lane == 2) - (lane == 0));
    }
    for (int round = 0; round < 300; round++) {
        vmask m = some_lanes(round);
        unsigned which = v_mask_bits(m);
        vindex at = v_index_u16(m, places);
        v_store(v_gather(a, at), found);
        for (int lane = 0; lane < LANES; lane++)
            assert_bits("v_gather", found[lane], a[places[which >> lane & 1 ? lane : 0]], 0, 0);
        v_permute_store(at, v_load(a), to);
        assert_memory_equal(to, found, sizeof found);
        v_compress_store_int(m, numbers, packed);
        v_permute_store(v_compress_index(m), v_load(a), found);
        for (int lane = 0, k = 0; lane < LANES; lane++)
            if (which >> lane & 1) {
                assert_int_equal(packed[k], numbers[lane]);
                assert_bits("v_compress_index", found[k++], a[lane], 0, 0);
            }
        for (int i = 0; i < 3 * LANES; i++)
            to[i] = (float)i;
        unsigned there = (1u << v_count(m)) - 1;
        v_move_lanes(to, there, to + LANES, which, 1);
        for (int lane = 0, k = 0; lane < LANES; lane++)
            if (which >> lane & 1)
                assert_true(to[k++] == (float)(LANES + lane));
    }
    for (int i = 0; i < 4 * LANES; i++)
        to[i] = (float)i;
    v_store(v_load_block_row(to), found); // four floats of each of LANES / 4 blocks
    for (int lane = 0; lane < LANES; lane++)
        assert_true(found[lane] == (float)(lane % 4 + lane / 4 * LANES));
}

TEST(test_doubles) {
    for (int first = 0; first < PAIRS; first += LANES) {
        float a[LANES], b[LANES], found[LANES];
        pairs(first, a, b);
        vfloat va = v_load(a), vb = v_load(b);
        vhalf x[2] = {v_half_low(va), v_half_high(va)}, y[2] = {v_half_low(vb), v_half_high(vb)};
        for (int lane = 0; lane < LANES; lane++) {
            double p = (double)a[lane], q = (double)b[lane];
            int half = lane / (LANES / 2), i = lane % (LANES / 2);
#define DOUBLES(word, expected)                                                                    \
    assert_true(isnan(expected) ? isnan((word)[i])                                                 \
                                : memcmp(&(double){(word)[i]}, &(double){expected}, 8) == 0);
            DOUBLES(x[half], p)
            DOUBLES(v_half_madd(x[half], y[half], v_half_splat(0.1)), fma(p, q, 0.1))
            DOUBLES(v_half_nmadd(x[half], y[half], v_half_splat(0.1)), fma(-p, q, 0.1))
            DOUBLES(v_half_sqrt(x[half]), sqrt(p))
            DOUBLES(v_half_floor(x[half]), floor(p))
            if (p > 1e-30 && p < 1e30)
                assert_true(fabs(v_half_rsqrt_approx(x[half])[i] * sqrt(p) - 1) < 0x1p-11);
        }
        v_store(v_from_halves(x[0] * v_half_splat(3.0), x[1] * v_half_splat(3.0)), found);
        for (int lane = 0; lane < LANES; lane++)
            assert_bits("v_from_halves", found[lane], (float)((double)a[lane] * 3.0), a[lane], 3);
    }
}
#endif

int main(void) {
    if (!NEEDED) {
        printf("skipped: the CPU lacks what %d lanes need\n", LANES);
        return 0;
    }
    return cmocka_run_group_tests(registered, NULL, NULL);
}
