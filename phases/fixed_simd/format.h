// What a number of the phase is: how many bits of fraction, in which unit, by which roots. STEPWISE_FIXED says so.
#ifndef FIXED_FORMAT_H
#define FIXED_FORMAT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum clear { CLEAR_CORNERS, CLEAR_SAFE, CLEAR_LISTS, CLEAR_NEVER };

struct format {
    int bits;         // of fraction
    int unit;         // lengths are in units of 2^unit scene units
    int steps;        // of Newton in each root; 0: the article's roots, of which √ has none
    enum clear clear; // which blocks are cleared at once
    // The article's roots: bits before the point of what is normalised, of what √ is taken of.
    int wide, near;
    int to_wide,
        from_wide; // a number goes right by to_wide or left by from_wide to be a mantissa; one is 0
    int64_t
        least; // the smallest square that is normalised: 1/√ of a smaller one is no factor any more
    double scale;  // of a number with no length: 2^-bits
    double length; // of a length: 2^(unit−bits)
};

// A number from a double: the nearest.
typedef int64_t one;

one one_of(double a, const struct format *f);
// A length in scene units.
one length_of(double a, const struct format *f);

struct settings {
    int bits, unit; // unit: −1: the least that the scene fits in
    int steps;
    enum clear clear;
};

// False, with one line in `error` (512 bytes), if the text is none. NULL: the phase's own.
bool settings_read(const char *text, struct settings *settings, char *error);

struct model;
struct view;
// The format for a scene, wherever its paths lead; false with what does not fit in one line.
bool format_fit(const struct settings *settings, const struct model *model, const struct view *view,
                struct format *f, char error[512]);

// By how many powers of two the directions to a picture's pixels are made shorter, so that the longest, to its corners,
// is less than four. aspect: width / height.
int directions_shorter(const struct view *view, double aspect);
// Whether the roots take the shortest of them, ahead; false with what does not fit in one line.
bool directions_fit(const struct format *f, const struct view *view, double aspect,
                    char error[512]);

// In the form that is read; 128 bytes.
void format_say(const struct format *f, char *text);

#endif
