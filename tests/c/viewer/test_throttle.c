// The throttle of rod marching against programs whose time depends on the level alone.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "viewer/window/throttle.c"

// Plays `frames` frames that take ms[level], each with 4 ms beside the rendering. Returns how often the level changed.
static int play(struct throttle *throttle, const double ms[LAST + 1], int frames, bool full) {
    int changes = 0;
    for (int i = 0; i < frames; i++)
        changes += throttle_frame(throttle, ms[throttle->level], 4, full);
    return changes;
}

static void the_finest_level_that_fits_is_taken_and_kept(void **state) {
    (void)state;
    const double slow[] = {50, 40, 30, 12, 4}, fast[] = {2, 1, 1, 1, 1};
    struct throttle throttle = {.on = true};
    assert_int_equal(play(&throttle, slow, 200, true), 3);
    assert_int_equal(throttle.level, 3); // 12 ms of 12.7; the level before takes 30
    assert_int_equal(play(&throttle, slow, 1000, true), 0);
    assert_int_equal(play(&throttle, fast, 200, false), 0); // of a smaller picture: nothing follows
    assert_int_equal(play(&throttle, fast, 200, true), 3);
    assert_int_equal(throttle.level, 0);
    assert_int_equal(play(&throttle, fast, 1000, true), 0);
}

static void the_settings_and_the_time_are_said(void **state) {
    (void)state;
    const double ms[] = {90, 80, 70, 60, 50};
    struct throttle throttle = {.on = true};
    char text[256];
    throttle_frame(&throttle, 3, 4, true);
    throttle_say(&throttle, text, sizeof text);
    assert_string_equal(text,
                        "throttle 0 of 4 (T): rods of 16 to 2 pixels by all steps, pixels by all; "
                        "3.0 of 12.7 ms");
    assert_false(throttle_spent(&throttle));
    play(&throttle, ms, 100, true);
    throttle_say(&throttle, text, sizeof text);
    assert_non_null(
        strstr(text, "rods of 32 to 8 pixels by 32 steps, pixels by 64; 50.0 of 12.7 ms"));
    assert_true(throttle_spent(&throttle));
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
        cmocka_unit_test(the_settings_and_the_time_are_said),
        cmocka_unit_test(each_level_is_coarser_than_the_one_before),
    };
    return cmocka_run_group_tests_name("throttle", tests, NULL, NULL);
}
