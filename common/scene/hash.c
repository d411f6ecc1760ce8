// A scene's hash. It depends on the values only, not on how the file writes them.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene/internal.h"

// FNV-1a by G. Fowler, L. C. Noll and K.-P. Vo.
static uint64_t hash_text(uint64_t h, const char *text) {
    for (; *text; text++)
        h = (h ^ (unsigned char)*text) * 0x100000001b3u;
    return (h ^ 0xff) * 0x100000001b3u; // marks the end of the text: 0xff does not occur in UTF-8
}

static int by_name(const void *a, const void *b) {
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

// Hashes keys in alphabetical order and every number as a hexadecimal double. False: memory is short.
static bool hash_json(uint64_t *h, json_t *value) {
    char number[40];
    bool ok = true;
    if (json_is_object(value)) {
        size_t count = json_object_size(value), i = 0;
        const char **names = malloc((count + 1) * sizeof *names), *name;
        json_t *member;
        if (!names)
            return false;
        json_object_foreach(value, name, member) names[i++] = name;
        qsort(names, count, sizeof *names, by_name);
        *h = hash_text(*h, "{");
        for (i = 0; i < count && ok; i++) {
            *h = hash_text(*h, names[i]);
            ok = hash_json(h, json_object_get(value, names[i]));
        }
        free(names);
    } else if (json_is_array(value)) {
        *h = hash_text(*h, "[");
        for (size_t i = 0; i < json_array_size(value) && ok; i++)
            ok = hash_json(h, json_array_get(value, i));
    } else if (json_is_number(value)) {
        snprintf(number, sizeof number, "%a", json_number_value(value) + 0.0); // −0 is 0
        *h = hash_text(*h, number);
    } else // a checked scene has only strings besides
        *h = hash_text(*h, json_string_value(value));
    *h = hash_text(*h, "}");
    return ok;
}

bool scene_hash(json_t *root, const struct limits *march, char hash[17]) {
    char used[64];
    uint64_t h = 0xcbf29ce484222325u;
    if (!hash_json(&h, root))
        return false;
    snprintf(used, sizeof used, "%a %d", march->hit_distance, march->max_steps);
    snprintf(hash, 17, "%016llx", (unsigned long long)hash_text(h, used));
    return true;
}
