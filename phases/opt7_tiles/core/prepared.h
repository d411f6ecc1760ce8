// The prepared scene: core/prepare_shape.c and core/update.c. No lanes in here.
#pragma once

#include "scene/scene.h"

#include "core/eval_kind.h" // needs scene.h

#include "core/primitive.h" // needs both

struct groups; // groups/program.h

struct prepared {
    struct model model;
    struct primitive *primitives; // one per shape
    struct groups *groups;        // NULL: the scene has none
    struct shape_list all;
};

// The most packets of a group, which march together. Without a fractal SMALL_GROUP is enough: more packets would
// share longer lists of shapes.
enum { GROUP = 16, SMALL_GROUP = 4 };
