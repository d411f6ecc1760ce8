// The article's parameters and the variants that it compares, read from STEPWISE_RODS. Unset: the article's own.
#pragma once

#include <stdbool.h>

struct settings {
    bool pixels; // march=pixels: each pixel's ray by itself, as in opt2; else march=rods
    int down;    // rods from top to bottom at the start; they are square
    int least;   // pixels: a rod with no longer side is not split, and all its pixels get its hit
    bool safe;   // step=safe: a step is the distance less the radius; else step=whole: the distance
    // picture=map: R is the t of the march's last point, G the distance there, B the steps; else picture=shaded.
    bool map;
};

// Reads STEPWISE_RODS's text; NULL gives the article's settings.
// Returns false, with one line in `error` (512 bytes), if the text is no setting.
bool settings_read(const char *text, struct settings *settings, char *error);

// Writes all settings in the form that settings_read takes; `text` has 128 bytes.
void settings_say(const struct settings *settings, char *text);
