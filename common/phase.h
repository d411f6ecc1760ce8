// The interface between a phase and the rest of Stepwise. A phase is a folder whose C
// files define the functions below. common/driver/driver.c has the only main.
//
// Code inside the timed region belongs to the phase. Code outside it, and code that must be the
// same for a fair comparison, belongs to common/. A phase includes files of its own tree and of
// common/, never files of another phase.
//
// The driver calls these functions in this order:
//     phase_unsupported, phase_picture_unsupported   before anything else
//     phase_prepare                                  once per scene; timed separately as set-up
//     phase_update                                   before each frame of an animation; timed
//     phase_render                                   once per frame; timed
//     phase_release                                  at the end
// Every phase defines phase_prepare, phase_update, phase_render, phase_release and phase_distances.
// The other functions are optional.
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include "frame/frame.h"
#include "scene/scene.h"

// Each phase defines this type for itself: the scene in the form that its renderer needs.
struct prepared;

// Optional. Returns NULL if the phase renders this scene correctly, else the reason in one sentence.
// The driver prints the reason and refuses the scene: a phase never draws a wrong picture.
const char *phase_unsupported(const struct scene *scene) __attribute__((weak));

// Returns why a phase that draws no groups ("groups" of phase.json is not true) cannot draw this scene; else NULL.
static inline const char *groups_unsupported(bool draws, const struct scene *scene) {
    return draws || scene->model.features.groups == 0
               ? NULL
               : "groups, modifiers, capsules, ellipsoids and gyroids are not drawn by this phase; "
                 "baseline draws them";
}

// Optional. Returns NULL if the phase renders this scene at width × height pixels, else the reason
// in one sentence. Called only if phase_unsupported gave none. For phases whose number range
// limits the picture's size (see systems/fixed).
const char *phase_picture_unsupported(const struct scene *scene, int width, int height)
    __attribute__((weak));

// Returns what can be computed once per scene from shapes, materials and limits, or NULL if memory
// is short. Camera and light are not available here, so nothing that depends on them escapes the
// timed region. The caller keeps `model` until phase_release.
// `threads`: the number of threads that phase_render and phase_update use, 1 to 4096; above 1 only
// if phase.json says "threads": true.
struct prepared *phase_prepare(const struct model *model, int threads);

// Renders one frame; this is the timed region. Writes every plane of `frame` that is not NULL. Camera and
// light are new each time: all work that depends on them happens here. Returns false if memory is short.
bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame);

// Replaces the shapes' positions by those of `model`, before a frame of an animation (render --frames); its
// time counts as the frame's. `model` has the shapes of phase_prepare's, whose `animated` is then true, and
// lives as long. Returns false if memory is short.
bool phase_update(struct prepared *prepared, const struct model *model);

// Frees `prepared` and ends the threads that phase_prepare started.
void phase_release(struct prepared *prepared);

// For tests, not timed. Writes the signed distance and the index of the nearest shape at each of `count`
// points, in the arithmetic of the phase's march. Returns false if memory is short.
bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest);

// What phase_prepare did in a phase that generates code for the scene. Strings live as long as
// `prepared`; times are nanoseconds.
struct kernel_facts {
    bool generated;     // true: generated code renders; false: the phase's general code does
    const char *reason; // why general code renders; NULL if `generated`
    const char *hash, *compiler; // of the generated code; NULL if there is none
    uint64_t generate_ns, compile_ns, load_ns;
};

// Optional, for phases that generate code. The driver adds the result to every record, so that a
// time of general code cannot be mistaken for a time of generated code.
const struct kernel_facts *phase_kernel(const struct prepared *prepared) __attribute__((weak));

// Optional. Returns the settings in use, of phases that an environment variable changes, as text; the driver
// adds it to every record, so that times of different settings cannot be confused.
const char *phase_settings(const struct prepared *prepared) __attribute__((weak));

// Rays as arrays, for phase_hits. Each array has 64 spare bytes after its last element, so that full
// vectors can be read and written there. Directions have unit length.
struct ray_set {
    size_t count;
    const float *origin[3], *direction[3];
    const float *far; // largest t of each ray; NULL: the rays do not end
    bool any;         // true: an occlusion query: does the ray hit any shape before `far`?
    float *t;         // result: distance of the first hit, +inf on a miss; −inf if `any` and hit
    float *shape;     // result: index of the shape hit, −1 on a miss; not written if `any`
};

// Optional, for phases with closed forms: traces the rays in their order, on the calling thread, for tests
// and tools/hits.c. Returns false if memory is short.
bool phase_hits(const struct prepared *prepared, const struct ray_set *rays);

// Optional, for truth; used by tests (tools/probe.c). A ray is six numbers, origin and direction; its hit is
// at origin + s·direction, s ≥ 0. Writes five: status (2 proved, 1 marched, 0 undecided), the first
// shape (−1: none), bounds of s (+inf on a proved miss), and the number of evaluations.
bool phase_enclosures(const struct prepared *prepared, size_t count, const double *rays,
                      double *enclosures);
