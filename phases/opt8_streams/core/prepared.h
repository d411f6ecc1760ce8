// The prepared scene: core/prepare_shape.c and core/update.c. No lanes in here.
#pragma once

#include <stddef.h>

#include "scene/scene.h"

#include "core/eval_kind.h" // needs scene.h

#include "core/primitive.h" // needs both

struct groups; // groups/program.h

// bulb/bulb_single.c marches for hit distances below this: above it a hit depends on step lengths, which it has to
// 2⁻¹³ only.
#define BULB_SINGLE_HIT 1e-4

struct prepared {
    struct model model;
    struct primitive *primitives; // one per shape
    struct groups *groups;        // NULL: the scene has none
    struct shape_list all;
    int bulbs;        // number of Mandelbulbs
    bool single_bulb; // one Mandelbulb and at most a plane: see is_single_bulb()
    bool all_bounded; // every shape has a bounding sphere or is a plane: shadow cones apply
    float lit_slope;  // slope of the shadow cones: see core/update.c
};

// Returns the first shape of a type, or NULL.
static inline const struct primitive *single_shape(enum shape_type type,
                                                   const struct prepared *scene) {
    for (int i = 0; i < scene->model.shape_count; i++)
        if (scene->primitives[i].type == type)
            return &scene->primitives[i];
    return NULL;
}

// Packets of rays that march together: a group.
enum { GROUP = 4, SMALL_GROUP = GROUP };
