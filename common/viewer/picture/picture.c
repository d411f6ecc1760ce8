// False colours, differences, PSNR.
#include "viewer/picture/picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene/words.h"

static const char *const MODE_NAMES[MODES] = {"colours", "difference", "evals",
                                              "depth",   "normals",    "ids"};

const char *mode_name(enum mode mode) {
    return MODE_NAMES[mode];
}

enum mode mode_find(const char *name) {
    int mode; // MODES: there is none
    word_among(name, MODE_NAMES, MODES, &mode);
    return (enum mode)mode;
}

bool mode_needs_planes(enum mode mode) {
    return mode >= MODE_EVALS;
}

static uint8_t byte_of(double unit) {
    return (uint8_t)lround(255 * fmax(0, fmin(1, unit)));
}

static void heat(double evals, uint8_t out[3]) {
    static const double ramp[6][3] = {{0, 0, 0}, {0, 0, 1}, {0, 1, 1},
                                      {0, 1, 0}, {1, 1, 0}, {1, 0, 0}};
    double at = 5 * fmin(1, log2(1 + fmax(0, evals)) / 8); // NaN becomes 0: fmax ignores it
    int below = at >= 5 ? 4 : (int)at;
    for (int i = 0; i < 3; i++)
        out[i] = byte_of(ramp[below][i] + (at - below) * (ramp[below + 1][i] - ramp[below][i]));
}

static void id_colour(double id, uint8_t out[3]) {
    double hue = 6 * fmod(0.618033988749895 * id, 1); // the golden ratio spreads neighbours
    double value = 1 - 0.3 * fmod(id, 3);
    for (int i = 0; i < 3; i++) {
        double distance = fabs(fmod(hue + 2 * i, 6) - 3);
        out[i] = id < 0 ? 0 : byte_of(value * fmax(0.15, fmin(1, distance - 1)));
    }
}

// The nearest and farthest hit; false: no pixel hits.
static bool depth_range(const struct frame *frame, double *nearest, double *farthest) {
    size_t pixels = (size_t)frame->width * (size_t)frame->height;
    *nearest = INFINITY;
    *farthest = -INFINITY;
    for (size_t i = 0; i < pixels; i++)
        if (isfinite(frame->depth[i])) {
            *nearest = fmin(*nearest, frame->depth[i]);
            *farthest = fmax(*farthest, frame->depth[i]);
        }
    return *nearest <= *farthest;
}

void picture_paint(enum mode mode, const struct frame *frame, const struct presenter *presenter,
                   uint8_t *rgb8) {
    size_t pixels = (size_t)frame->width * (size_t)frame->height;
    double nearest = 0, farthest = 0;
    if (!mode_needs_planes(mode)) {
        frame_present(presenter, frame, rgb8);
        return;
    }
    if (mode == MODE_DEPTH)
        depth_range(frame, &nearest, &farthest);
    for (size_t i = 0; i < pixels; i++) {
        uint8_t *out = rgb8 + 3 * i;
        double grey, depth = frame->depth[i];
        switch (mode) {
        case MODE_EVALS: heat(frame->evals[i], out); break;
        case MODE_IDS: id_colour(frame->id[i], out); break;
        case MODE_NORMALS:
            for (size_t k = 0; k < 3; k++)
                out[k] = frame->id[i] < 0 ? 0 : byte_of((frame->normal[3 * i + k] + 1) / 2);
            break;
        default:
            grey = farthest > nearest
                       ? 0.15 + 0.85 * (1 / depth - 1 / farthest) / (1 / nearest - 1 / farthest)
                       : 1;
            memset(out, isfinite(depth) ? byte_of(grey) : 0, 3);
        }
    }
}

void picture_difference(const uint8_t *a, const uint8_t *b, size_t samples, double times,
                        uint8_t *out) {
    for (size_t i = 0; i < samples; i++)
        out[i] = (uint8_t)fmin(255, times * abs(a[i] - b[i]));
}

double picture_psnr(const struct frame *a, const struct frame *b) {
    size_t samples = 3 * (size_t)a->width * (size_t)a->height;
    double sum = 0;
    for (size_t i = 0; i < samples; i++) {
        if (!isfinite(a->rgb[i]) || !isfinite(b->rgb[i]))
            return NAN;
        double d = fmax(0, fmin(1, a->rgb[i])) - fmax(0, fmin(1, b->rgb[i]));
        sum += d * d;
    }
    return sum > 0 ? -10 * log10(sum / (double)samples) : INFINITY;
}

void picture_legend(enum mode mode, const struct frame *frame, char *text, size_t size) {
    size_t pixels = (size_t)frame->width * (size_t)frame->height;
    double nearest, farthest, sum = 0, most = 0;
    *text = '\0';
    if (mode == MODE_DEPTH && depth_range(frame, &nearest, &farthest))
        snprintf(text, size, "depth: white %.4g, dark %.4g (grey: its inverse), black: no hit",
                 nearest, farthest);
    else if (mode == MODE_DEPTH)
        snprintf(text, size, "depth: no ray hits a shape");
    else if (mode == MODE_NORMALS)
        snprintf(text, size, "normals: red x, green y, blue z, grey 0");
    else if (mode == MODE_IDS)
        snprintf(text, size, "shape ids: one colour each");
    if (mode != MODE_EVALS)
        return;
    for (size_t i = 0; i < pixels; i++) {
        sum += frame->evals[i];
        most = fmax(most, frame->evals[i]);
    }
    snprintf(text, size,
             "evaluations of a camera ray: mean %.1f, most %.0f%s\n"
             "black 0, blue 2, cyan 8, green 27, yellow 83, red 255 and more",
             sum / (double)pixels, most, most > 1 ? "" : " (this phase counts none)");
}
