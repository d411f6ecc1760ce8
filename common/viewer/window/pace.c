// Adaptive resolution. A frame's time grows with its pixels, so the height goes with the root of it.
#include "viewer/window/pace.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// The budget is of 16.7 ms; the rest is for the window system.
static const double BUDGET_MS = 14.5, STILL_MS = 200, LONGEST_MS = 1000;
enum { LEAST_HEIGHT = 36, HEIGHT_STEP = 9, UP_AFTER = 10, DOWN_AFTER = 3 };

static int by_time(const void *a, const void *b) {
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

void times_add(struct times *times, uint64_t ns) {
    times->ns[times->next] = ns;
    times->next = (times->next + 1) % TIMES;
    times->count += times->count < TIMES;
}

uint64_t times_percentile(const struct times *times, int percent) {
    uint64_t sorted[TIMES];
    if (times->count == 0)
        return 0;
    memcpy(sorted, times->ns, sizeof sorted);
    qsort(sorted, (size_t)times->count, sizeof *sorted, by_time);
    int rank = (percent * times->count + 99) / 100;
    return sorted[rank < 1 ? 0 : rank - 1];
}

double times_rate(const struct times *times) {
    uint64_t sum = 0;
    int frames = 0;
    for (; frames < times->count && sum < 1000000000u; frames++)
        sum += times->ns[(times->next + TIMES - 1 - frames) % TIMES];
    return sum > 0 ? frames * 1e9 / (double)sum : 0;
}

void pace_start(struct pace *pace, int most) {
    int least = most < LEAST_HEIGHT ? most : LEAST_HEIGHT;
    *pace = (struct pace){.adaptive = pace->adaptive,
                          .throttled = pace->throttled,
                          .height = least,
                          .least = least,
                          .most = most,
                          .says = "finding the resolution"};
}

// Returns the height at which rendering takes `budget` milliseconds.
static int fitting(const struct pace *pace, double budget) {
    double height = pace->height * sqrt(budget / fmax(pace->render_ms, 0.001));
    if (height >= pace->most)
        return pace->most;
    int stepped = (int)height / HEIGHT_STEP * HEIGHT_STEP;
    return stepped < pace->least ? pace->least : stepped;
}

// `budget`: of rendering, for 60 frames a second.
static const char *what_it_did(const struct pace *pace, double budget, double other_ms,
                               bool still) {
    bool late = pace->render_ms > budget;
    if (!pace->adaptive && pace->throttled)
        return pace->height == pace->most ? "full, while the throttle adapts"
                                          : "what takes a second, while the throttle adapts";
    if (!pace->adaptive)
        return pace->height == pace->most ? "full, by key R" : "what takes a second, by key R";
    if (still && late)
        return "refined while nothing moves";
    if (pace->height == pace->most)
        return "full";
    if (late && pace->height == pace->least)
        return "the least; 60 frames a second are out of reach";
    if (other_ms > BUDGET_MS / 2)
        return "lowered; showing it takes too long for 60 frames a second";
    return "lowered to hold 60 frames a second";
}

bool pace_frame(struct pace *pace, double render_ms, double other_ms, bool still) {
    // Where showing a picture alone takes long, a smaller one would help little: keep half for it.
    double moving = fmax(BUDGET_MS - other_ms, BUDGET_MS / 2);
    double budget = !pace->adaptive ? LONGEST_MS : still ? STILL_MS : moving;
    pace->render_ms = pace->settled == 0 ? render_ms : 0.7 * pace->render_ms + 0.3 * render_ms;
    pace->settled++;
    int wanted = fitting(pace, budget);
    // A step up must be worth it, and wait, so that the picture does not flicker between two sizes.
    bool up = wanted > pace->height && (wanted > 1.1 * pace->height || wanted == pace->most) &&
              (pace->settled >= UP_AFTER || wanted > 1.5 * pace->height);
    bool down =
        wanted < pace->height && (pace->settled >= DOWN_AFTER || pace->render_ms > 2 * budget);
    if (up || down) {
        // What a small picture takes tells little about a large one: at most twice as high at once.
        pace->height = wanted > 2 * pace->height ? 2 * pace->height : wanted;
        pace->settled = 0;
    }
    pace->says = what_it_did(pace, moving, other_ms, still);
    return up || down;
}
