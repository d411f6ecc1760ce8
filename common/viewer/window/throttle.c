// Chooses among a few settings of rods and packets. W. Edwards, "Rod Marching" (article, 6 July 2012), proposes a
// throttle that adapts as the viewpoint changes.
#include "viewer/window/throttle.h"

#include <math.h>
#include <stdio.h>

enum { DOWN_AFTER = 4, UP_AFTER = 30, FAR_TOO_SLOW = 4 };
static const double FRAME_MS = 1000.0 / 60;

// Rods of `size` to `least` pixels make at most `steps` steps, each pixel then at most `finish`. 0: the scene's cap. Fewer
// than 64 steps lose most of a fractal's surface.
static const struct level {
    int size, least, steps, finish;
} LEVELS[] = {
    {16, 2, 0, 0}, {32, 8, 0, 0}, {32, 8, 32, 128}, {32, 8, 32, 96}, {32, 8, 32, 64},
};

enum { LAST = sizeof LEVELS / sizeof *LEVELS - 1 };

const char *throttle_phase(void) {
    return "rods_simd";
}

const char *throttle_settings(const struct throttle *throttle) {
    static char text[128];
    const struct level *level = &LEVELS[throttle->level];
    snprintf(text, sizeof text, "march=rods size=%d least=%d steps=%d finish=%d", level->size,
             level->least, level->steps, level->finish);
    return text;
}

bool throttle_frame(struct throttle *t, double render_ms, double other_ms, bool full) {
    t->render_ms = t->settled == 0 ? render_ms : 0.7 * t->render_ms + 0.3 * render_ms;
    t->settled++;
    t->budget_ms = fmax(FRAME_MS - other_ms, FRAME_MS / 2);
    int step = 0;
    if (t->level < LAST && t->render_ms > FAR_TOO_SLOW * t->budget_ms)
        step = LAST - t->level; // no level is so much faster than its neighbour
    else if (t->level < LAST && t->settled >= DOWN_AFTER && t->render_ms > t->budget_ms)
        step = 1;
    else if (full && t->level > 0 && t->settled >= UP_AFTER && t->render_ms < 0.6 * t->budget_ms)
        step = -1; // the finer level takes up to 1.6 times as long
    if (step == 0)
        return false;
    t->level += step;
    t->settled = 0;
    return true;
}

bool throttle_spent(const struct throttle *t) {
    return t->level == LAST;
}

void throttle_say(const struct throttle *t, char *text, size_t size) {
    const struct level *level = &LEVELS[t->level];
    char steps[32] = "all", finish[32] = "all";
    if (level->steps)
        snprintf(steps, sizeof steps, "%d", level->steps);
    if (level->finish)
        snprintf(finish, sizeof finish, "%d", level->finish);
    snprintf(text, size,
             "throttle %d of %d, larger is coarser (T): %.1f of %.1f ms\n"
             "rods of %d to %d pixels: %s steps, then each pixel: %s",
             t->level, LAST, t->render_ms, t->budget_ms, level->size, level->least, steps, finish);
}
