// The throttle of rod marching: what phase rods_simd leaves out to hold 60 frames a second.
#pragma once

#include <stdbool.h>
#include <stddef.h>

struct throttle {
    bool on;
    int level;        // 0: the finest settings
    int settled;      // frames since the level changed
    double render_ms; // smoothed, at this level
    double budget_ms; // what a frame may take
};

const char *throttle_phase(void);
// Returns the settings of the level as STEPWISE_RODS takes them.
const char *throttle_settings(const struct throttle *throttle);
// Learns from a frame: its rendering, what else it took, and whether its resolution is full. Without that no finer
// level is taken. Where the frame is far too slow, the coarsest level is. Returns whether the level has changed.
bool throttle_frame(struct throttle *throttle, double render_ms, double other_ms, bool full);
// Returns whether there is no coarser level: the resolution has to fall then.
bool throttle_spent(const struct throttle *throttle);
// Says the frame's time and the settings in two lines.
void throttle_say(const struct throttle *throttle, char *text, size_t size);
