// What the article lets one choose, and what it compares: read from STEPWISE_RODS, so that one program is timed under all of
// them. Unset, the article's own.
#ifndef RODS_SETTINGS_H
#define RODS_SETTINGS_H

#include <stdbool.h>

struct settings {
    bool pixels; // march=pixels: each pixel's ray by itself, as phase opt2 does; march=rods
    int down;    // starting rods from top to bottom; as many to the right as the width takes
    int least; // pixels: a rod of no more on either side is not split, and all its pixels are what it found
    bool safe; // step=safe: a step is the distance less the radius; step=whole: the distance
    bool
        map; // picture=map: R last point in the march, G distance to impact there, B steps; picture=shaded
};

// False, with one line in `error` (512 bytes), if the text is none. NULL: the article's settings.
bool settings_read(const char *text, struct settings *settings, char *error);

// All of them, in the form that is read; `text` has room for 128 bytes.
void settings_say(const struct settings *settings, char *text);

#endif
