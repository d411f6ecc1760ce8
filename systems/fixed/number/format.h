// The number format: bits of fraction, unit of length and kind of square root. STEPWISE_FIXED sets it.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct model;
struct view;

// Which blocks of pixels become background at once. CORNERS: those where the rays through the corners miss (the
// article's test, which can be wrong). SAFE: those that no sphere can reach. LISTS: as SAFE, and the rays of the other
// blocks are tested only against the spheres that can reach the block. NEVER: none.
enum clear { CLEAR_CORNERS, CLEAR_SAFE, CLEAR_LISTS, CLEAR_NEVER };

struct format {
    int bits;         // of fraction
    int unit;         // lengths are in units of 2^unit scene units
    int newton_steps; // in each root; 0: the article's roots, where √ has none and 1/√ has two
    enum clear clear;
    // The article's roots alone: bits before the point of the arguments of √ and of 1/√.
    int sqrt_whole_bits, rsqrt_whole_bits;
    int rsqrt_shift_right, rsqrt_shift_left; // from a number to a mantissa; one of the two is 0
    int64_t rsqrt_least;                     // the least argument whose 1/√ still fits a factor
    double scale;                            // the value of a number's last bit: 2^-bits
    double length_scale; // the same of a length, in scene units: 2^(unit - bits)
};

struct settings {
    int bits, unit; // unit −1: the smallest that the scene fits in
    int newton_steps;
    enum clear clear;
};

// Reads STEPWISE_FIXED's text; NULL gives the phase's defaults.
// Returns false, with one line in `error` (512 bytes), if the text is no setting.
bool settings_read(const char *text, struct settings *settings, char *error);

// Writes the settings of a format in the form that settings_read takes; `text` has 128 bytes.
void settings_say(const struct format *f, char *text);

// What words should be of, for the user.
extern const char SETTINGS_FORM[];

// Sets one setting of the number format. Returns false if there is no such key or value.
bool format_set(const char *key, const char *value, struct settings *settings);

// Writes the settings of the number format, each followed by a blank.
void format_say(const struct format *f, char *text, size_t size);

// Returns the format that the settings ask for, in units of 2^unit; the fields of the article's roots are not set.
struct format format_make(const struct settings *settings, int unit);

// Chooses the format for a scene, wherever the paths of its shapes lead.
// Returns false, with what does not fit in `error`, if a number leaves its range.
bool format_fit(const struct settings *settings, const struct model *model, const struct view *view,
                struct format *f, char error[512]);

// Returns by how many powers of two the directions to the pixels are scaled down, so that all are shorter than 4.
// aspect: width/height of the picture, whose corners have the longest directions.
int direction_shift(const struct view *view, double aspect);

// Returns whether 1/√ takes the square of the shortest direction of a picture; if not, `error` says why.
bool directions_fit(const struct format *f, const struct view *view, double aspect,
                    char error[512]);
