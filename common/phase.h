// The only interface between a phase and the house. A phase is a folder phases/NAME that defines
// these functions; common/driver/driver.c is the only main.
//
// The rule: code inside the timed region belongs to the phase; code outside it, or that must be the
// same for a fair comparison, belongs to common/. A phase includes nothing of another phase.
#ifndef STEPWISE_PHASE_H
#define STEPWISE_PHASE_H

#include <stdbool.h>
#include <stddef.h>

#include "frame/frame.h"
#include "scene/scene.h"

struct prepared; // the phase's own

// NULL if the phase renders this scene, else the reason in one sentence; the driver then refuses.
const char *phase_unsupported(const struct scene *scene);

// Only of phases that have bounds for a picture's shape: the same of a picture of that size of a scene that it renders.
const char *phase_picture_unsupported(const struct scene *scene, int width, int height)
    __attribute__((weak));

// What may be worked out once per scene from shapes, materials and limits. Timed apart as set-up.
// The model outlives what is prepared from it. NULL when memory is short. Renders with that many
// threads; more than 1 only if phase.json says so.
struct prepared *phase_prepare(const struct model *model, int threads);

// The timed region. Camera and light are new for each frame: what depends on them is paid for here.
// Writes every plane of the frame that is not NULL. Returns false when memory is short.
bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame);

// Moved shapes: same counts, types and sizes as at phase_prepare, and as long-lived. Timed with the frame, before each
// of an animation's (render --frames; prepare's model is `animated` then). Returns false when memory is short.
bool phase_update(struct prepared *prepared, const struct model *model);

void phase_release(struct prepared *prepared);

// Not timed, for tests: the phase's own signed distance to the scene at each point (xyz triples),
// in the arithmetic that its march uses, and the index of the nearest shape.
bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest);

// Only of phases that generate code for a scene: what prepare came to. The record says it with every frame, so that
// general code cannot pass for generated.
struct kernel_facts {
    bool generated;              // else general code runs
    const char *reason;          // why it was not generated
    const char *hash, *compiler; // of a generated kernel
    uint64_t generate_ns, compile_ns, load_ns;
};
const struct kernel_facts *phase_kernel(const struct prepared *prepared) __attribute__((weak));

// Only of phases that can be told how to work, by a variable of the environment: what this one does, in words. The
// record says it with every frame, so that what another setting gave cannot pass for the phase's own.
const char *phase_settings(const struct prepared *prepared) __attribute__((weak));

// Only of phases of closed forms, for tests and for what times rays (hits.c): rays as arrays, of which each has room for
// 64 bytes more. Directions are of unit length.
struct ray_set {
    size_t count;
    const float *origin[3], *direction[3];
    const float *far; // where each ends; NULL: nowhere
    bool any;         // asked for is whether something is met, not where
    float *t, *shape; // of the first hit: +inf and −1 on a miss; of any: −inf in t, and no shape
};
bool phase_hits(const struct prepared *prepared, const struct ray_set *rays);

// Only of the phases of family "truth", for tests (rays.c): the first hit of each ray, origin xyz and
// direction xyz, as status (2 proved, 1 converged only, 0 undecided), index of the shape (−1: none), and the
// enclosure of s in p = origin + s·direction, s ≥ 0 (+inf on a proved miss), and what it cost in evaluations.
bool phase_enclosures(const struct prepared *prepared, size_t count, const double *rays,
                      double *enclosures);

#endif
