// The frame: the planes that a phase writes, the files they are stored in, and the picture as
// displayed.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { FRAME_MAX_PLANES = 32 };

struct presenter;

// Rows from top to bottom, pixels of a row next to each other. A phase writes every plane that is
// not NULL. `rgb` is linear, neither clamped nor gamma-corrected.
struct frame {
    int width, height;
    float *rgb;      // 3 per pixel
    float *depth;    // hit distance t along the camera ray, +inf on a miss
    float *id;       // index of the shape hit, −1 on a miss
    float *normal;   // 3 per pixel, unit length, towards the ray; 0 on a miss
    float *evals;    // distance evaluations (of the whole scene) in the camera ray's march
    int plane_count; // number of the phase's own planes (phase.json: "planes"), 0 without --aov
    float *planes[FRAME_MAX_PLANES];
    const char *const *plane_names; // EXR channel of each
    // For a picture that is only displayed, by a phase with "display" in phase.json: the planes above are
    // NULL, and the phase passes linear samples to `show`, which writes a byte of `shown` for each.
    uint8_t *shown; // 3 per pixel
    const struct presenter *presenter;
    void (*show)(const struct presenter *presenter, const float *linear, size_t samples,
                 uint8_t *shown);
};

// Allocates the planes; with `aov` also all others than `rgb`. Returns false if memory is short.
// `names`: the phase's own planes, ending with NULL, or NULL if it has none; they must outlive the
// frame. Samples start as NaN, so that a pixel that a phase forgets is noticed.
bool frame_create(struct frame *frame, int width, int height, bool aov, const char *const *names);

// Allocates a frame that is only displayed: `shown` and no planes. Returns false if memory is
// short. `presenter` must outlive the frame.
bool frame_create_display(struct frame *frame, int width, int height,
                          const struct presenter *presenter);

// Frees what either of them allocated, and clears the frame.
void frame_free(struct frame *frame);

// Sets `frame`'s rgb to the means of k × k samples of `large`, which is k times as wide and high. Samples
// are clamped to [0, 1] before: it is what the eye makes of `large` from afar. NaN where one is not finite.
void frame_average(const struct frame *large, int k, struct frame *frame);

// Writes a ZIP-compressed OpenEXR file of float channels: R G B, and with the other planes also Z,
// id, N.x, N.y, N.z, evals and the phase's own. The file is written under a temporary name and then
// renamed. Returns false with one line in `error` (at least 512 bytes).
bool frame_write_exr(const struct frame *frame, const char *path, char *error);

// Write the displayed picture, 3 bytes per pixel, as a PNG or as a binary PPM. Temporary name, result
// and `error` as for frame_write_exr.
bool frame_write_png(int width, int height, const uint8_t *rgb8, const char *path, char *error);
bool frame_write_ppm(int width, int height, const uint8_t *rgb8, const char *path, char *error);

// Returns whether `path` can be written. If not, `error` (at least 512 bytes) gets one line. Called
// before a long render.
bool frame_writable(const char *path, char *error);

// The presenter turns linear samples into displayed bytes: exactly trunc(255·min(1, c^0.4545)) in double
// precision for a positive c, 0 for negative numbers and NaN.

// Returns a presenter, or NULL if memory is short. frame_present will use up to `threads` threads,
// on the CPUs that the calling thread may run on now.
struct presenter *presenter_create(int threads);
void presenter_free(struct presenter *presenter);

// Converts `samples` samples on the calling thread. Fast for samples that were just written and are
// still in the cache; a frame's `show` is this function.
void presenter_show(const struct presenter *presenter, const float *linear, size_t samples,
                    uint8_t *shown);

// Converts the frame's `rgb` to rgb8, 3 bytes per pixel, on several threads if it is large enough.
void frame_present(const struct presenter *presenter, const struct frame *frame, uint8_t *rgb8);
