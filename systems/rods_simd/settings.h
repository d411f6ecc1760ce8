// The settings that the article's throttle would choose, read from STEPWISE_RODS. Unset: the phase's defaults.
#pragma once

#include <stdbool.h>

struct settings {
    bool pixels; // march=pixels: no rods; march=rods
    int size;    // pixels on a side of the starting rods: a power of two
    int least;   // pixels on a side of the smallest rods: a power of two, at most size
    int steps;   // most steps of all rods around a pixel; 0: the scene's cap
    int finish;  // most steps of a pixel's march behind the rods; 0: the scene's cap
};

// Reads the settings from `text`; NULL: the defaults. Returns false, with one line in `error` (512 bytes), if the text
// is wrong.
bool settings_read(const char *text, struct settings *settings, char *error);

// Writes all settings in the form that settings_read() reads. `text` has room for 128 bytes.
void settings_say(const struct settings *settings, char *text);
