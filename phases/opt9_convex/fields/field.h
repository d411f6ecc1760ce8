// A group as rays see it. Its program of shapes and operations is opt6_wide's (groups/). Points and rays are in the
// group's axes, relative to the centre of its sphere.
#pragma once

#include <stdbool.h>

#include "core/bvh.h"
#include "scene/scene.h"

struct prepared;
struct program; // groups/program.h

struct field {
    const struct program *program;
    float centre[3]; // of its sphere, in its frame; of a repeated group 0
    float radius;    // of its sphere
    float least;     // a field below this is 0: rounding
    float floor;     // steps along a shadow ray are no shorter
    float share;     // outside of its sphere it is no less than this share of the way there
    float lit_share; // as share; 0: it clears no shadow ray
    float bend;      // its field bends down by no more than this along a ray; 0: not known
    // Balls that hold the children's parts of the surface, of a union whose children have such; levels 0: the group is
    // marched as a whole.
    struct bvh balls;
    float wider;            // farther than this beyond its ball, a child has no part in the surface
    float *sphere;          // of each ball: its child's radius if that is a sphere, else 0
    int *first;             // step of each child; the last + 1: of the fold
    float blend, per_blend; // of a union that has spheres alone; else 0
    float grain;            // the least of its spheres' radii and the blend
};

struct field_set;

// Reserves the fields of the model's groups. Returns NULL if memory is short.
struct field_set *fields_reserve(const struct model *model);
void fields_free(struct field_set *set);
// Prepares them, again whenever the shapes have moved. `estimated`: shadows are the paper's estimate, which needs
// distances. Precondition: their programs are compiled.
void fields_prepare(struct field_set *set, const struct prepared *prepared, bool estimated);
struct field *field_of(struct field_set *set, int i);
