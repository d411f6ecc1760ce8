// See settings.h.
#include "settings.h"

#include <stdio.h>
#include <string.h>

static const char *const TREES[] = {"bvh", "kd", "none", NULL};
static const char *const ROOTS[] = {"exact", "newton", NULL};
static const char *const RAYS[] = {"auto", "together", "alone", NULL};
static const struct {
    const char *key;
    const char *const *values;
} KEYS[] = {{"tree", TREES}, {"root", ROOTS}, {"rays", RAYS}};
enum { KEY_COUNT = 3 };

static bool same_word(const char *text, size_t length, const char *word) {
    return strlen(word) == length && strncmp(text, word, length) == 0;
}

// Finds the numbers of key and value of a word "key=value". Returns false if there is no such pair.
static bool find_setting(const char *word, size_t length, int *key, int *value) {
    const char *equals = memchr(word, '=', length);
    if (!equals)
        return false;
    size_t before = (size_t)(equals - word), behind = length - before - 1;
    for (*key = 0; *key < KEY_COUNT; ++*key)
        if (same_word(word, before, KEYS[*key].key))
            for (*value = 0; KEYS[*key].values[*value]; ++*value)
                if (same_word(equals + 1, behind, KEYS[*key].values[*value]))
                    return true;
    return false;
}

bool settings_read(const char *text, struct settings *settings, char *error) {
    int chosen[KEY_COUNT] = {0}, key, value;
    while (text && *text) {
        size_t length = strcspn(text, " ");
        if (!find_setting(text, length, &key, &value)) {
            snprintf(error, 512,
                     "STEPWISE_PACKETS: \"%.*s\": should be of tree=bvh|kd|none root=exact|newton "
                     "rays=auto|together|alone",
                     length < 100 ? (int)length : 100, text);
            return false;
        }
        chosen[key] = value;
        text += length + (text[length] == ' ');
    }
    *settings =
        (struct settings){(enum tree_kind)chosen[0], chosen[1] == 1, (enum ray_mode)chosen[2]};
    return true;
}

void settings_print(const struct settings *settings, char *text) {
    snprintf(text, 64, "tree=%s root=%s rays=%s", TREES[settings->tree], ROOTS[settings->newton],
             RAYS[settings->rays]);
}
