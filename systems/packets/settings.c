// See settings.h.
#include "settings.h"

#include <stdio.h>
#include <string.h>

#include "scene/words.h"

static const char *const TREES[] = {"bvh", "kd", "none"};
static const char *const ROOTS[] = {"exact", "newton"};
static const char *const RAYS[] = {"auto", "together", "alone"};

static bool set_setting(const char *key, const char *value, struct settings *settings) {
    int found;
    if (strcmp(key, "tree") == 0 && word_among(value, TREES, 3, &found))
        settings->tree = (enum tree_kind)found;
    else if (strcmp(key, "root") == 0 && word_among(value, ROOTS, 2, &found))
        settings->newton = found == 1;
    else if (strcmp(key, "rays") == 0 && word_among(value, RAYS, 3, &found))
        settings->rays = (enum ray_mode)found;
    else
        return false;
    return true;
}

bool settings_read(const char *text, struct settings *settings, char *error) {
    *settings = (struct settings){0};
    return words_read(text, "STEPWISE_PACKETS",
                      "tree=bvh|kd|none root=exact|newton rays=auto|together|alone", set_setting,
                      settings, error);
}

void settings_print(const struct settings *settings, char *text) {
    snprintf(text, 64, "tree=%s root=%s rays=%s", TREES[settings->tree], ROOTS[settings->newton],
             RAYS[settings->rays]);
}
