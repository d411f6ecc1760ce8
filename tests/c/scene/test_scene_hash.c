// A scene's hash. It depends on the content alone, not on white space or the order of keys. Any other number in the file
// gives another hash.
#include "scene_paths.h"

static void hash_of(const json_t *root, size_t flags, const struct scene_overrides *overrides,
                    char hash[17]) {
    char *text = json_dumps(root, flags);
    assert_non_null(text);
    assert_true(load_bytes(text, strlen(text), overrides));
    free(text);
    memcpy(hash, scene.hash, 17);
    scene_free(&scene);
    assert_int_equal(strspn(hash, "0123456789abcdef"), 16);
}

TEST(hash_follows_content) {
    char plain[17], other[17];
    json_t *root = parse(WHOLE), *reversed = json_object();
    hash_of(root, JSON_COMPACT, NULL, plain);
    hash_of(root, JSON_INDENT(4) | JSON_SORT_KEYS, NULL, other);
    assert_string_equal(plain, other); // white space and the order of keys do not matter
    static const char *const keys[] = {"shapes",     "materials", "march", "fog",
                                       "background", "light",     "camera"};
    for (size_t i = 0; i < LENGTH(keys); i++)
        json_object_set(reversed, keys[i], json_object_get(root, keys[i]));
    hash_of(reversed, 0, NULL, other);
    assert_string_equal(plain, other);
    json_decref(reversed);

    static const struct {
        struct scene_overrides overrides;
        bool same;
    } cases[] = {{{0, 0}, true},     {{1e-6, 0}, true}, {{0, 300}, true},    {{1e-6, 300}, true},
                 {{2e-6, 0}, false}, {{0, 301}, false}, {{2e-6, 301}, false}};
    for (size_t i = 0; i < LENGTH(cases); i++) {
        hash_of(root, 0, &cases[i].overrides, other);
        assert_int_equal(strcmp(plain, other) == 0, cases[i].same);
    }
    json_decref(root);

    static struct paths paths; // every number of the file matters
    collect_whole(&paths);
    size_t changed = 0;
    for (size_t i = 0; i < paths.count; i++) {
        if (paths.type[i] != JSON_INTEGER && paths.type[i] != JSON_REAL)
            continue;
        const char *path = paths.path[i];
        const char *value = ends_in(path, "power") ? NULL : ends_in(path, "bailout") ? "17" : "1";
        if (!value || !accepted(path, value))
            continue;
        memcpy(other, scene.hash, 17);
        scene_free(&scene);
        json_t *before = parse(WHOLE), *after = edited(path, value);
        bool equal = json_equal(before, after);
        json_decref(before);
        json_decref(after);
        if ((strcmp(plain, other) == 0) != equal)
            fail_msg("%s := %s: hash %s", path, value, other);
        changed += !equal;
    }
    assert_true(changed > 40);
}

RUN_TESTS(make_file, remove_file)
