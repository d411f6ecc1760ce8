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

// Packets of rays that march together: a group.
enum { GROUP = 4 };
