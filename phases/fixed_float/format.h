// What a number of the phase is: a float; and what STEPWISE_FIXED says of the blocks.
#ifndef FIXED_FORMAT_H
#define FIXED_FORMAT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum clear { CLEAR_CORNERS, CLEAR_SAFE, CLEAR_LISTS, CLEAR_NEVER };

struct format {
    enum clear clear;     // which blocks are cleared at once
    int bits;             // of a shift: none
    double scale, length; // of a number as a float: 1
};

typedef float one;

struct settings {
    enum clear clear;
};

// False, with one line in `error` (512 bytes), if the text is none. NULL: the phase's own.
bool settings_read(const char *text, struct settings *settings, char *error);

// In the form that is read; 128 bytes.
void format_say(const struct format *f, char *text);

#endif
