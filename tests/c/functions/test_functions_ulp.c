// Errors in ulp (common/functions): held against exact powers of two and neighbours.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "common/functions/exhaustive.c"
#include "common/functions/targets.c"

// The measuring, which these tests do not reach.
bool search_in_threads(const struct search *search) {
    (void)search;
    return false;
}

static void test_ulp(void **state) {
    (void)state;
    const struct {
        double value, as_float, as_double;
    } cases[] = {{1.0, 0x1p-23, 0x1p-52},
                 {-1.0, 0x1p-23, 0x1p-52},
                 {1.999, 0x1p-23, 0x1p-52},
                 {2.0, 0x1p-22, 0x1p-51},
                 {0x1.fffffffffffffp-1, 0x1p-24, 0x1p-53},
                 {0x1p-126, 0x1p-149, 0x1p-178},
                 {0x1p-127, 0x1p-149, 0x1p-179},
                 {0x1p-149, 0x1p-149, 0x1p-201},
                 {0x1p127, 0x1p104, 0x1p75},
                 {0x1p-1022, 0x1p-149, 0x1p-1074},
                 {0x1p-1074, 0x1p-149, 0x1p-1074}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_true(ulp_of(cases[i].value, false) == cases[i].as_float);
        assert_true(ulp_of(cases[i].value, true) == cases[i].as_double);
        assert_true(ulps_per_unit(cases[i].value) == 1 / cases[i].as_float);
    }
}

// A float's upper neighbour is 1 ulp away, the middle half of one; the sizes are no multiple of
// LANES.
static void test_compare(void **state) {
    (void)state;
    enum { COUNT = 1003 };
    static struct buffers at;
    for (size_t i = 0; i < COUNT; i++) {
        uint32_t bits = 0x00800000u + (uint32_t)i * 2097143u, above = bits + 1;
        float value, next_one;
        memcpy(&value, &bits, 4);
        memcpy(&next_one, &above, 4);
        at.a[i] = at.got[i] = value;
        at.exact[i] = i % 2 ? (double)value + ((double)next_one - (double)value) / 2 : value;
        at.per_ulp[i] = ulps_per_unit(at.exact[i]);
    }
    struct error e = compare(&at, COUNT);
    assert_true(e.largest == 0.5 && e.count == COUNT && e.non_finite == 0);
    assert_true(e.sum_of_squares == 0.25 * (COUNT / 2));

    uint32_t off;
    memcpy(&off, &at.got[1000], 4); // past the last whole group
    off += 3;
    memcpy(&at.got[1000], &off, 4);
    e = compare(&at, COUNT);
    assert_true(e.largest == 3);
    find_worst(&at, COUNT, &e);
    assert_true(e.worst_a == at.a[1000]);

    for (int i = 0; i < 2; i++) {
        at.got[i ? 1002 : 17] = i ? INFINITY : NAN;
        e = compare(&at, COUNT);
        assert_true(e.non_finite == (uint64_t)i + 1);
        assert_true(isinf(e.largest) && isfinite(e.sum_of_squares));
    }
}

static void test_add(void **state) {
    (void)state;
    struct error sum = {0}, a = {.largest = 2, .sum_of_squares = 3, .worst_a = 7, .count = 5},
                 b = {.largest = 1, .sum_of_squares = 4, .worst_a = 9, .count = 6, .non_finite = 1};
    error_add(&sum, &a);
    error_add(&sum, &b);
    assert_true(sum.largest == 2 && sum.sum_of_squares == 7 && sum.worst_a == 7);
    assert_true(sum.count == 11 && sum.non_finite == 1);
}

// Samples stay in their span, in either format, and fill their stratum's place.
static void test_sample(void **state) {
    (void)state;
    struct random random = {5};
    const struct span span = {0x1p-10, 12, true};
    int negative = 0, low = 0;
    for (uint64_t i = 0; i < 4096; i++) {
        bool by_bits = i & 1, is_double = i >> 1 & 1;
        double x = sample(&span, i, 4096, by_bits, is_double, &random);
        assert_true(fabs(x) >= 0x1p-10 && fabs(x) <= 12);
        assert_true(is_double || (double)(float)x == x);
        if (!by_bits)
            assert_true(fabs(fabs(x) - 12 * ((double)i + 0.5) / 4096) <= 12.1 / 4096);
        negative += x < 0;
        low += by_bits && fabs(x) < 0.125; // 7 of 13.6 binades
    }
    assert_true(negative > 1900 && negative < 2200);
    assert_true(low > 900 && low < 1200);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_ulp), cmocka_unit_test(test_compare),
                                       cmocka_unit_test(test_add), cmocka_unit_test(test_sample)};
    return cmocka_run_group_tests_name("errors in ulp", tests, NULL, NULL);
}
