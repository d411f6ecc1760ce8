// What the phase can be told by STEPWISE_PACKETS; unset, what its notes say is best.
#ifndef PACKETS_SETTINGS_H
#define PACKETS_SETTINGS_H

#include <stdbool.h>

enum tree_kind { TREE_BVH, TREE_KD, TREE_NONE };
enum going { GO_AUTO, GO_TOGETHER, GO_ALONE };

struct settings {
    enum tree_kind tree; // none: every ray is asked of every shape
    bool
        newton; // root=newton: the CPU's approximate inverse root and one step of Newton's; root=exact
    enum going rays; // through the tree in bundles, each alone, or as they diverge
};

// False, with one line in `error` (512 bytes), if the text is none. NULL: the phase's own settings.
bool settings_read(const char *text, struct settings *settings, char *error);

// All of them, in the form that is read; `text` has room for 64 bytes.
void settings_say(const struct settings *settings, char *text);

#endif
