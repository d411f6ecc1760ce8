// The throttle of rod marching against programs whose time depends on the level alone.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "viewer/window/throttle.c"

// Plays `frames` frames that take ms[level], each with 4 ms beside the rendering. Returns how often the level changed.
static int play(struct throttle *throttle, const double ms[LAST + 1], int frames) {
    int changes = 0;
    for (int i = 0; i < frames; i++)
        changes += throttle_frame(throttle, ms[throttle->level], 4);
    return changes;
}

static void the_finest_level_that_fits_is_taken_and_kept(void **state) {
    (void)state;
    const double slow[] = {50, 40, 30, 12, 8, 4}, fast[] = {2, 1, 1, 1, 1, 1};
    struct throttle throttle = {.on = true};
    assert_int_equal(play(&throttle, slow, 200), 3);
    assert_int_equal(throttle.level, 3); // 12 ms of 12.7; the level before takes 30
    assert_int_equal(play(&throttle, slow, 1000), 0);
    assert_int_equal(play(&throttle, fast, 200), 3);
    assert_int_equal(throttle.level, 0);
    assert_int_equal(play(&throttle, fast, 1000), 0);
}

static void what_is_out_of_reach_is_said(void **state) {
    (void)state;
    const double ms[] = {90, 80, 70, 60, 50, 40};
    struct throttle throttle = {.on = true};
    char text[256];
    play(&throttle, ms, 100);
    assert_int_equal(throttle.level, LAST);
    throttle_say(&throttle, text, sizeof text);
    assert_non_null(strstr(text, "rods of 32 to 8 pixels, at most 4 steps"));
    assert_non_null(strstr(text, "40.0 of 12.7 ms: out of reach"));
    throttle = (struct throttle){.on = true};
    throttle_frame(&throttle, 3, 4);
    throttle_say(&throttle, text, sizeof text);
    assert_non_null(
        strstr(text, "rods of 16 to 2 pixels, all steps; then a pixel's own, all steps"));
    assert_null(strstr(text, "out of reach"));
}

static void each_level_is_coarser_than_the_one_before(void **state) {
    (void)state;
    for (int i = 1; i <= LAST; i++) {
        const struct level *fine = &LEVELS[i - 1], *coarse = &LEVELS[i];
        assert_true(coarse->least >= fine->least && coarse->size >= fine->size);
        assert_true(fine->steps == 0 || (coarse->steps > 0 && coarse->steps <= fine->steps));
        assert_true(fine->finish == 0 || (coarse->finish > 0 && coarse->finish <= fine->finish));
        struct throttle throttle = {.level = i};
        assert_non_null(strstr(throttle_settings(&throttle), "march=rods size="));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_finest_level_that_fits_is_taken_and_kept),
        cmocka_unit_test(what_is_out_of_reach_is_said),
        cmocka_unit_test(each_level_is_coarser_than_the_one_before),
    };
    return cmocka_run_group_tests_name("throttle", tests, NULL, NULL);
}
