// Scenes that are refused: a key that is missing or unknown, a value of the wrong type, broken JSON, no file. Each
// error is one printable line that says where.
//
// A walk over WHOLE leaves out, mistypes and overflows each value in turn, so that no key can be added to the format
// without its refusals.
#include "scene_paths.h"

// A value that is left out is reported at its path. So are a value of the wrong type and a number beyond the largest.
// Every object refuses an unknown key.
TEST(every_value_is_checked) {
    static struct paths paths;
    collect_whole(&paths);
    for (size_t i = 0; i < paths.count; i++) {
        const char *path = paths.path[i];
        bool element = ends_in(path, "]");
        bool optional = ends_in(path, "position") && path[0] == 's';
        optional = optional || ends_in(path, "rotation_degrees") || ends_in(path, "repeat");
        optional = optional || ends_in(path, "].path") || ends_in(path, "rounding");
        optional = optional || strcmp(path, "camera.path") == 0;
        static const char *const modifiers[] = {".blend", ".shell",   ".mirror",
                                                ".twist", "].offset", ".displace"};
        for (size_t k = 0; k < LENGTH(modifiers) && strncmp(path, "shapes[5]", 9) != 0; k++)
            optional = optional || ends_in(path, modifiers[k]);
        bool material = strncmp(path, "materials.", 10) == 0 && !strchr(path + 10, '.');
        if (!element && !optional && !material)
            refused(path, NULL, NULL, NULL);
        refused(path, "null", NULL, NULL);
        refused(path, "true", NULL, NULL);
        refused(path, paths.type[i] == JSON_STRING ? "[1,2,3]" : "'text'", NULL, NULL);
        refused(path, paths.type[i] == JSON_OBJECT ? "[]" : "{}", NULL, NULL);
        if (paths.type[i] == JSON_INTEGER || paths.type[i] == JSON_REAL) {
            refused(path, "2e9", NULL, NULL);
            refused(path, "[1]", NULL, NULL);
        }
        if (paths.type[i] == JSON_OBJECT) {
            char inner[128];
            snprintf(inner, sizeof inner, "%s.colour", path);
            refused(inner, "1", NULL, NULL);
        }
    }
    refused("lights", "1", NULL, NULL);
}

// Broken JSON is refused with the place of the error: file:line:column.
TEST(broken_json) {
    static const struct {
        const char *text;
        int line, column;
    } cases[] = {
        {"", 1, 0},
        {"{", 1, 1},
        {"{\n  \"fog\": 1,\n  \"fog\": 2\n}", 3, 7},
        {"{\n  \"fog\": NaN\n}", 2, 12},
        {"{\n  \"fog\": 1e999\n}", 2, 14},
        {"{\n  \"fog\": 1\n}\nmore", 4, 4},
    };
    for (size_t i = 0; i < LENGTH(cases); i++) {
        assert_false(load_bytes(cases[i].text, strlen(cases[i].text), NULL));
        char expected[SCENE_ERROR_SIZE];
        snprintf(expected, sizeof expected, "%s:%d:%d: ", file_name, cases[i].line,
                 cases[i].column);
        assert_memory_equal(error, expected, strlen(expected));
    }
    static const char not_text[] = "{\"a\xff\": 1}";
    assert_false(load_bytes(not_text, sizeof not_text - 1, NULL));
    assert_non_null(strstr(error, ".json:1:"));
    static char deep[10000]; // must not overflow the stack
    memset(deep, '[', sizeof deep);
    assert_false(load_bytes(deep, sizeof deep, NULL));
    assert_non_null(strstr(error, ".json:1:"));
    assert_false(load_bytes("[1, 2]", 6, NULL));
    assert_non_null(strstr(error, ".json: $: "));
}

TEST(unreadable_files) {
    assert_false(scene_load("/nowhere/scene.json", NULL, &scene, error));
    assert_non_null(strstr(error, "/nowhere/scene.json: "));
    assert_false(scene_load("/tmp", NULL, &scene, error));
    assert_non_null(strstr(error, "/tmp: "));
}

RUN_TESTS(make_file, remove_file)
