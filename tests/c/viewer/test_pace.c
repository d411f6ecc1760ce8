// Percentiles of frame times, and the adaptive resolution against phases of known cost.
#include "tests/c/testing.h"

#include "viewer/window/pace.c"

TEST(percentiles_are_nearest_ranks) {
    struct times times = {0};
    assert_int_equal(times_percentile(&times, 50), 0);
    for (uint64_t i = 100; i >= 1; i--) // the last 60 are 60 … 1
        times_add(&times, i);
    assert_int_equal(times.count, 60);
    assert_int_equal(times_percentile(&times, 50), 30);
    assert_int_equal(times_percentile(&times, 99), 60);
    assert_int_equal(times_percentile(&times, 1), 1);
    times_add(&times, 1000);
    assert_int_equal(times_percentile(&times, 99), 1000);
    struct times few = {0};
    for (uint64_t i = 1; i <= 3; i++)
        times_add(&few, i);
    assert_int_equal(times_percentile(&few, 50), 2);
}

TEST(the_rate_is_of_the_last_second) {
    struct times times = {0};
    assert_true(times_rate(&times) == 0);
    for (int i = 0; i < 100; i++)
        times_add(&times, 10000000);
    assert_true(fabs(times_rate(&times) - 100) < 1e-9); // 60 frames of 10 ms
    for (int i = 0; i < 2; i++)
        times_add(&times, 400000000);
    assert_true(fabs(times_rate(&times) - 22) < 1e-9); // 2 of 400 ms and 20 of 10 ms
    times_add(&times, 2000000000);
    assert_true(fabs(times_rate(&times) - 0.5) < 1e-9);
}

// Frames of a phase that takes `ns` a pixel at 16:9, each with 4 ms beside the rendering. Returns the
// longest rendering of the last 100 frames in ms.
static double play(struct pace *pace, double ns, int frames, bool still) {
    double longest = 0;
    for (int i = 0; i < frames; i++) {
        double ms = ns * pace->height * pace->height * 16 / 9 / 1e6;
        pace_frame(pace, ms, 4, still);
        if (i >= frames - 100)
            longest = fmax(longest, ms);
    }
    return longest;
}

TEST(sixty_frames_a_second_are_held) {
    const double costs[] = {20, 50, 200, 500, 2000};
    for (int i = 0; i < 5; i++) {
        struct pace pace = {.adaptive = true};
        pace_start(&pace, 720);
        assert_int_equal(pace.height, 36);
        double ms = play(&pace, costs[i], 300, false);
        assert_true(ms <= 16.667 - 4);
        // Not less than the budget of 10.5 ms allows, but for a step of 9 rows and the 10 % of a step up.
        double ideal = sqrt(10.5e6 / costs[i] * 9 / 16);
        assert_true(pace.height > ideal / 1.1 - 9 && pace.height <= ideal);
        assert_non_null(strstr(pace.says, "lowered"));
    }
}

TEST(a_fast_phase_is_shown_in_full_and_a_slow_one_is_told) {
    const double costs[] = {5, 27000};
    const char *const says[] = {"full", "out of reach"};
    for (int i = 0; i < 2; i++) {
        struct pace pace = {.adaptive = true};
        pace_start(&pace, 720);
        play(&pace, costs[i], 200, false);
        assert_int_equal(pace.height, i ? 36 : 720);
        assert_non_null(strstr(pace.says, says[i]));
    }
}

TEST(at_rest_a_frame_has_a_fifth_of_a_second) {
    struct pace pace = {.adaptive = true};
    pace_start(&pace, 720);
    play(&pace, 500, 200, false);
    int moving = pace.height;
    double ms = play(&pace, 500, 200, true);
    assert_true(ms > 150 && ms <= 200);
    assert_non_null(strstr(pace.says, "refined"));
    // Three frames after something moves it is back.
    play(&pace, 500, 3, false);
    assert_true(pace.height <= moving + 9);
}

TEST(without_adaption_a_frame_has_a_second) {
    struct pace pace = {.adaptive = false};
    pace_start(&pace, 720);
    play(&pace, 500, 200, false); // 461 ms
    assert_int_equal(pace.height, 720);
    pace_start(&pace, 720);
    assert_true(play(&pace, 27000, 200, false) <= 1000); // 25 s would be the full frame
    assert_non_null(strstr(pace.says, "a second"));
}

RUN_TESTS(NULL, NULL)
