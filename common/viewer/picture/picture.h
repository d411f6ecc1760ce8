// Pictures as bytes: colours, false colours, differences, and the canvas that they are shown on.
#pragma once

#include "frame/frame.h"

enum mode { MODE_COLOURS, MODE_DIFFERENCE, MODE_EVALS, MODE_DEPTH, MODE_NORMALS, MODE_IDS, MODES };

// Names as in scripts: colours, difference, evals, depth, normals, ids.
const char *mode_name(enum mode mode);
// Returns the mode of this name, MODES if there is none.
enum mode mode_find(const char *name);
// Returns whether the mode needs the frame's planes beside its colours.
bool mode_needs_planes(enum mode mode);

// Writes 3 bytes per pixel. Evaluations: black 0, then blue, cyan, green, yellow, red at 256, logarithmic.
// Depth: white at the nearest hit, dark at the farthest, between by 1/depth, black on a miss. Normals: (n +
// 1)/2. Ids: a colour each.
void picture_paint(enum mode mode, const struct frame *frame, const struct presenter *presenter,
                   uint8_t *rgb8);
// Writes min(255, times * |a - b|) for each of `samples` bytes.
void picture_difference(const uint8_t *a, const uint8_t *b, size_t samples, double times,
                        uint8_t *out);
// Returns the PSNR in dB of `a` to `b`: both frames' linear colours, clamped to 0..1, of equal size.
// Infinite for equal pictures, NaN if a colour is not finite.
double picture_psnr(const struct frame *a, const struct frame *b);

// One line about the mode's numbers in this frame, for the overlay.
void picture_legend(enum mode mode, const struct frame *frame, char *text, size_t size);

enum { FONT_LINE = 10 }; // height of a line
// font.c: returns a column, 0 to 4, of an ASCII character: bit 0 is the top row, bit 7 is below the base line.
unsigned font_column(char character, int column);

// What is shown: 0xRRGGBB per pixel, rows from top to bottom.
struct canvas {
    int width, height;
    uint32_t *pixels;
};

// Scales a picture to the whole canvas by nearest pixels, and writes columns from..to-1 of it.
void canvas_scale(struct canvas *canvas, const uint8_t *rgb8, int width, int height, int from,
                  int to);
// Writes ASCII text, glyphs of 5 x 7 in cells of 6 x 9, each `scale` pixels wide. Lines end at '\n'.
void canvas_text(struct canvas *canvas, int x, int y, int scale, uint32_t colour, const char *text);
// Darkens a rectangle, so that text on it can be read.
void canvas_shade(struct canvas *canvas, int x, int y, int width, int height);
// Writes a PNG of 8 bits. Returns false with one line in `error` (SCENE_ERROR_SIZE bytes).
bool canvas_write_png(const struct canvas *canvas, const char *path, char *error);
