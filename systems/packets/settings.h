// The phase's settings, which the environment variable STEPWISE_PACKETS changes. All zero: the
// default.
#pragma once

#include <stdbool.h>

enum tree_kind { TREE_BVH, TREE_KD, TREE_NONE }; // none: one leaf holds all solids
enum ray_mode { RAYS_AUTO, RAYS_TOGETHER, RAYS_ALONE };

struct settings {
    enum tree_kind tree;
    bool
        newton; // roots: the CPU's approximate inverse root and one Newton step, not the exact root
    enum ray_mode
        rays; // through the tree: together where they go the same way, always together, or singly
};

// Reads words like "tree=kd root=newton", separated by one space. NULL or "": the default. Returns
// false, with one line in `error` (512 bytes), for any other text.
bool settings_read(const char *text, struct settings *settings, char *error);

// Writes all settings in the form that settings_read reads; `text` has room for 64 bytes.
void settings_print(const struct settings *settings, char *text);
