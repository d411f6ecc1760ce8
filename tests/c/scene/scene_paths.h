// The paths of all values in WHOLE ("shapes[3].radius"), and each value's type in JSON.
#pragma once

#include "scene_file.h"

enum { MOST_PATHS = 256 };

struct paths {
    char path[MOST_PATHS][96];
    json_type type[MOST_PATHS];
    size_t count;
};

static inline void collect(json_t *value, const char *path, struct paths *paths) {
    if (*path) {
        assert_true(paths->count < MOST_PATHS);
        snprintf(paths->path[paths->count], sizeof *paths->path, "%s", path);
        paths->type[paths->count++] = json_typeof(value);
    }
    char inner[96];
    const char *key;
    json_t *item;
    json_object_foreach(value, key, item) {
        snprintf(inner, sizeof inner, "%.40s%s%.40s", path, *path ? "." : "", key);
        collect(item, inner, paths);
    }
    for (size_t i = 0; i < json_array_size(value); i++) {
        snprintf(inner, sizeof inner, "%.60s[%zu]", path, i);
        collect(json_array_get(value, i), inner, paths);
    }
}

static inline void collect_whole(struct paths *paths) {
    json_t *root = parse(WHOLE);
    paths->count = 0;
    collect(root, "", paths);
    json_decref(root);
    assert_true(paths->count > 100);
}

static inline bool ends_in(const char *text, const char *ending) {
    size_t length = strlen(text), end = strlen(ending);
    return length >= end && strcmp(text + length - end, ending) == 0;
}
