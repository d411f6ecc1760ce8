// What the article would have a throttle choose, read from STEPWISE_RODS; unset, what the phase's notes say.
#ifndef SETTINGS_H
#define SETTINGS_H

#include <stdbool.h>

struct settings {
    bool pixels; // march=pixels: no rods; march=rods
    int size;    // pixels on a side of the starting rods: a power of two
    int least;   // of the smallest: a power of two, no more than size
    int steps;   // of the rods that a pixel is in, together; 0: the scene's cap
    int finish;  // of the pixel's own march behind them; 0: the scene's cap
};

// False, with one line in `error` (512 bytes), if the text is none. NULL: the phase's own settings.
bool settings_read(const char *text, struct settings *settings, char *error);

// All of them, in the form that is read; `text` has room for 128 bytes.
void settings_say(const struct settings *settings, char *text);

#endif
