// The throttle of rod marching against programs whose time depends on the level alone.
#include "tests/c/testing.h"

#include <string.h>

#include "viewer/window/throttle.c"

// Plays `frames` frames that take ms[level], each with 4 ms beside the rendering. Returns how often the level changed.
static int play(struct throttle *throttle, const double ms[LAST + 1], int frames, bool full) {
    int changes = 0;
    for (int i = 0; i < frames; i++)
        changes += throttle_frame(throttle, ms[throttle->level], 4, full);
    return changes;
}

TEST(the_finest_level_that_fits_is_taken_and_kept) {
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

// From there the finer ones are tried, as ever.
TEST(the_coarsest_is_taken_at_once_where_a_frame_is_far_too_slow) {
    const double slow[] = {700, 600, 500, 400, 300}, mixed[] = {700, 30, 12, 5, 4};
    struct throttle throttle = {.on = true};
    assert_int_equal(play(&throttle, slow, 1, true), 1);
    assert_true(throttle_spent(&throttle));
    throttle = (struct throttle){.on = true};
    assert_int_equal(play(&throttle, mixed, 1, true), 1);
    play(&throttle, mixed, 200, true);
    assert_int_equal(throttle.level, 2);
}

TEST(the_settings_and_the_time_are_said) {
    const double ms[] = {90, 80, 70, 60, 50};
    struct throttle throttle = {.on = true};
    char text[256];
    throttle_frame(&throttle, 3, 4, true);
    throttle_say(&throttle, text, sizeof text);
    assert_non_null(strstr(text, " 3.0 of 12.7 ms\n"));
    assert_non_null(strstr(text, " 16 to 2 "));
    assert_false(throttle_spent(&throttle));
    play(&throttle, ms, 100, true);
    throttle_say(&throttle, text, sizeof text);
    assert_non_null(strstr(text, " 50.0 of 12.7 ms\n"));
    assert_non_null(strstr(text, " 32 to 8 "));
    assert_non_null(strstr(text, ": 64"));
    assert_true(throttle_spent(&throttle));
}

TEST(each_level_is_coarser_than_the_one_before) {
    for (int i = 1; i <= LAST; i++) {
        const struct level *fine = &LEVELS[i - 1], *coarse = &LEVELS[i];
        assert_true(coarse->least >= fine->least && coarse->size >= fine->size);
        assert_true(fine->steps == 0 || (coarse->steps > 0 && coarse->steps <= fine->steps));
        assert_true(fine->finish == 0 || (coarse->finish > 0 && coarse->finish <= fine->finish));
        struct throttle throttle = {.level = i};
        assert_non_null(strstr(throttle_settings(&throttle), "march=rods size="));
    }
}

RUN_TESTS(NULL, NULL)
