// Scenes that are refused: a key that is missing or unknown, a value of the wrong type, broken JSON, no file. Each
// error is one printable line that says where.
//
// A walk over WHOLE leaves out, mistypes and overflows each value in turn, so that no key can be added to the format
// without its refusals.
#include "scene_paths.h"

// A value that is left out is reported at its path. So are a value of the wrong type and a number beyond the largest.
// Every object refuses an unknown key.
static void every_value_is_checked(void **state) {
    (void)state;
    static struct paths paths;
    collect_whole(&paths);
    for (size_t i = 0; i < paths.count; i++) {
        const char *path = paths.path[i];
        bool element = ends_in(path, "]");
        bool optional = ends_in(path, "position") && path[0] == 's';
        optional = optional || ends_in(path, "rotation_degrees") || ends_in(path, "repeat");
        optional = optional || ends_in(path, "].path") || ends_in(path, "rounding");
        optional = optional || strcmp(path, "camera.path") == 0;
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
    refused("lights", "1", NULL,
            "unknown key; known here: camera, light, background, fog, march, materials, shapes");
}

// Broken JSON is refused with the place of the error: file:line:column.
static void broken_json(void **state) {
    (void)state;
    static const struct {
        const char *text;
        int line, column;
        const char *message;
    } cases[] = {
        {"", 1, 0, "'[' or '{' expected near end of file"},
        {"{", 1, 1, "string or '}' expected near end of file"},
        {"{\n  \"fog\": 1,\n  \"fog\": 2\n}", 3, 7, "duplicate object key near '\"fog\"'"},
        {"{\n  \"march\": {\"a\": 1,\n   \"a\": 2}\n}", 3, 6, "duplicate object key near '\"a\"'"},
        {"{\n  \"fog\": NaN\n}", 2, 12, "invalid token near 'NaN'"},
        {"{\n  \"fog\": Infinity\n}", 2, 17, "invalid token near 'Infinity'"},
        {"{\n  \"fog\": 1e999\n}", 2, 14, "real number overflow near '1e999'"},
        {"{\n\n  \"fog\": 99999999999999999999\n}", 3, 29,
         "too big integer near '99999999999999999999'"},
        {"{\n  \"fog\": 01\n}", 2, 10, "invalid token near '0'"},
        {"{\n  \"fog\": 1,\n}", 3, 1, "string or '}' expected near '}'"},
        {"{\n  \"fog\" 1\n}", 2, 9, "':' expected near '1'"},
        {"{\n  'fog': 1\n}", 2, 3, "string or '}' expected near '''"},
        {"{\n  \"fog\": 1\n}\nmore", 4, 4, "end of file expected near 'more'"},
        {"{\n  \"fog\": \"half\n}", 2, 14, "unexpected newline near '\"half'"},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        assert_false(load_bytes(cases[i].text, strlen(cases[i].text), NULL));
        char expected[SCENE_ERROR_SIZE];
        snprintf(expected, sizeof expected, "%s:%d:%d: %s", file_name, cases[i].line,
                 cases[i].column, cases[i].message);
        assert_string_equal(error, expected);
    }
    static const char not_text[] = "{\"a\xff\": 1}";
    assert_false(load_bytes(not_text, sizeof not_text - 1, NULL));
    assert_non_null(strstr(error, ".json:1:"));
    static char deep[10000]; // must not overflow the stack
    memset(deep, '[', sizeof deep);
    assert_false(load_bytes(deep, sizeof deep, NULL));
    assert_non_null(strstr(error, ".json:1:"));
    assert_false(load_bytes("[1, 2]", 6, NULL));
    assert_non_null(strstr(error, ".json: $: an array where an object is required"));
}

// An error may repeat text of the file. That text must not break the line or send control characters to a terminal.
static void errors_are_one_printable_line(void **state) {
    (void)state;
    static const char *const cases[][2] = {
        {"a\nrender: forged", "1"},
        {"\x1b"
         "c",
         "1"},
        {"fog", "'x\\ny'"},
        {"light.shadows", "'so\\nft\\u0007'"},
        {"shapes[0].type", "'sphere\\r\\n'"},
        {"shapes[0].material", "'white\\n'"},
        {"materials.white\nblack", "{}"},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        assert_false(accepted(cases[i][0], cases[i][1]));
        for (const char *c = error; *c; c++)
            if ((unsigned char)*c < ' ' || *c == 0x7f)
                fail_msg("a control character (%d) in: %s", *c, error);
    }
}

static void long_names_stay_in_their_buffers(void **state) {
    (void)state;
    char key[600], path[700];
    memset(key, 'k', sizeof key - 1);
    key[sizeof key - 1] = '\0';
    static const char *const prefixes[] = {"", "camera.", "materials.", "shapes[0]."};
    for (size_t i = 0; i < COUNT(prefixes); i++) {
        json_t *root = parse(WHOLE), *at = root;
        if (i == 1 || i == 2)
            at = json_object_get(root, i == 1 ? "camera" : "materials");
        else if (i == 3)
            at = json_array_get(json_object_get(root, "shapes"), 0);
        json_object_set_new(at, key, parse("{'color':1}"));
        bool loaded = load_json(root, 0);
        json_decref(root);
        assert_false(loaded);
        snprintf(path, sizeof path, ": $.%skkkkkkkk", prefixes[i]);
        assert_non_null(strstr(error, path));
        assert_true(strlen(error) < SCENE_ERROR_SIZE);
    }
    char *name = malloc(3000);
    assert_non_null(name);
    memset(name, 'x', 2999);
    name[2999] = '\0';
    assert_false(scene_load(name, NULL, &scene, error));
    free(name);
}

static void unreadable_files(void **state) {
    (void)state;
    assert_false(scene_load("/nowhere/scene.json", NULL, &scene, error));
    assert_string_equal(error,
                        "/nowhere/scene.json: cannot read the scene: No such file or directory");
    assert_false(scene_load("/tmp", NULL, &scene, error));
    assert_string_equal(error, "/tmp: cannot read the scene: Is a directory");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_value_is_checked),
        cmocka_unit_test(broken_json),
        cmocka_unit_test(errors_are_one_printable_line),
        cmocka_unit_test(long_names_stay_in_their_buffers),
        cmocka_unit_test(unreadable_files),
    };
    return cmocka_run_group_tests_name("scene_errors", tests, make_file, remove_file);
}
