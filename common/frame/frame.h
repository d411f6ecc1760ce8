// The frame: what a phase writes, how it is stored, and how it is shown.
#ifndef STEPWISE_FRAME_H
#define STEPWISE_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { FRAME_MOST_PLANES = 32 };

struct presenter;

// Row-major, top row first. `rgb` is linear, neither clamped nor gamma-corrected. The other planes
// are NULL unless asked for: a phase writes those that are not.
struct frame {
    int width, height;
    float *rgb;      // 3 per pixel
    float *depth;    // hit distance t along the camera ray, +inf on a miss
    float *id;       // index of the shape hit, −1 on a miss
    float *normal;   // 3 per pixel, unit length, towards the ray; 0 on a miss
    float *evals;    // distance evaluations (of the whole scene) of the camera ray's march
    int plane_count; // the planes of phase.json's "planes", in its order; 0 unless asked for
    float *planes[FRAME_MOST_PLANES];
    const char *const *plane_names; // of channels
    // A picture that is only to be displayed, asked of a phase whose phase.json says "display": all planes above are
    // NULL, and it hands finished linear samples to `show`, which writes as many bytes of `shown`.
    uint8_t *shown; // 3 per pixel
    const struct presenter *presenter;
    void (*show)(const struct presenter *presenter, const float *linear, size_t samples,
                 uint8_t *shown);
};

// Every sample is preset to NaN, so that a pixel a phase forgot cannot pass for a colour. `names`: of the
// phase's own planes, up to a NULL; they are there with `aov` only.
bool frame_create(struct frame *frame, int width, int height, bool aov, const char *const *names);
// One to be displayed, of which `presenter` outlives it.
bool frame_create_shown(struct frame *frame, int width, int height,
                        const struct presenter *presenter);
void frame_free(struct frame *frame);

// Writes float channels R G B [Z id N.x N.y N.z evals and the phase's own] with ZIP compression under a temporary name,
// then renames it. Returns false with one line in `error` (at least 512 bytes).
bool frame_write_exr(const struct frame *frame, const char *path, char *error);

// The picture as displayed, 3 bytes a pixel, as a binary PPM; the same otherwise.
bool frame_write_ppm(int width, int height, const uint8_t *rgb8, const char *path, char *error);

// Whether `path` could be written: asked before a long render.
bool frame_writable(const char *path, char *error);

// Gamma and 8 bits: trunc(255·min(1, c^0.4545)) of each linear value, 0 for negatives and NaN, in
// exact agreement with that formula evaluated in double (present.c), by the widest vectors there are and, of a
// picture large enough for them, up to `threads` threads, on the CPUs that the caller has when it creates it.
struct presenter *presenter_create(int threads);
void presenter_free(struct presenter *presenter);
// On the caller's thread, of samples that it has just written; a frame's `show`.
void presenter_show(const struct presenter *presenter, const float *linear, size_t samples,
                    uint8_t *shown);
void frame_present(const struct presenter *presenter, const struct frame *frame, uint8_t *rgb8);

#endif
