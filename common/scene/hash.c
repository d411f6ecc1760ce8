// A scene's hash: of the values, not of their spelling.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene/parts.h"

// FNV-1a, Fowler, Noll and Vo.
static uint64_t hash_text(uint64_t h, const char *text) {
    for (; *text; text++)
        h = (h ^ (unsigned char)*text) * 0x100000001b3u;
    return (h ^ 0xff) * 0x100000001b3u; // no byte of UTF-8: the end
}

static int by_name(const void *a, const void *b) {
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

// Of the value, not of its spelling: keys in order, every number as a hexadecimal double.
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
    } else // a checked scene has nothing else but strings
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
