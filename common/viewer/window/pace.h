// Frame times, and the resolution that holds 60 frames a second.
#pragma once

#include <stdbool.h>
#include <stdint.h>

enum { TIMES = 60 };

// The last frames' times, in nanoseconds.
struct times {
    uint64_t ns[TIMES];
    int count, next;
};

void times_add(struct times *times, uint64_t ns);
// Returns the smallest time that at least `percent` per cent of the frames do not exceed (nearest
// rank); 0 if there is none. 50 is the median; of 60 frames the 99th percentile is the longest.
uint64_t times_percentile(const struct times *times, int percent);
// Returns frames a second over the last second, or over the last 60 frames if they took less; 0 if there is none.
double times_rate(const struct times *times);

// Chooses the rendered pictures' height from what frames took.
struct pace {
    bool adaptive;  // else `most`, unless a frame would take longer than a second
    bool throttled; // by the throttle, and not by key R
    int height, least, most;
    double render_ms; // smoothed time of rendering at this height
    int settled;      // frames since the height changed
    const char *says; // what it did, for the overlay
};

// Starts at the least height: what a frame of the phase costs is not known yet.
void pace_start(struct pace *pace, int most);
// Learns from a frame: milliseconds of its rendering, which grows with its pixels, and of the rest. `still`:
// a frame may take a fifth of a second. Returns whether the height has changed.
bool pace_frame(struct pace *pace, double render_ms, double other_ms, bool still);
