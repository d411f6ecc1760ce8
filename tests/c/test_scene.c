// Reading a scene: every refusal with its place, and what an accepted scene becomes.
//
// WHOLE uses every key of the format. A walk over it leaves out, mistypes and overflows each value
// in turn, so that no key can be added to the format without its refusals; a table holds the
// limits.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "scene/scene.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))

static const char WHOLE[] =
    "{'camera':{'position':[1,2,3],'look_at':[4,-1,9],'up':[0.1,1,0.2],'vertical_fov_degrees':40},"
    "'light':{'position':[5,6,7],'emission':[8,9,10],'shadows':'hard','shadow_strength':3},"
    "'background':[0.1,0.2,0.3],'fog':1e-5,"
    "'march':{'max_steps':300,'hit_distance':1e-6,'bounds_radius':100,'max_bounces':2,"
    "'normal_step':1e-4,'surface_offset':1e-3},"
    "'materials':{'white':{'color':[1,0.9,0.8],'reflectivity':0,'shininess':15},"
    "'mirror':{'color':[0.3,0.2,0.1],'reflectivity':0.5,'shininess':20}},"
    "'shapes':[{'type':'sphere','radius':1.5,'material':'mirror','position':[1,2,3],"
    "'rotation_degrees':[10,20,30],'repeat':[4,0,5],"
    "'path':{'type':'circle','centre':[0,1,3],'axis':[0,0,2],'period':8}},"
    "{'type':'box','half_size':[1,2,3],'rounding':0.25,'material':'white',"
    "'path':{'type':'line','to':[4,-8,0.5],'period':2}},"
    "{'type':'torus','major_radius':2,'minor_radius':0.5,'material':'white'},"
    "{'type':'cone','bottom_radius':2,'top_radius':1,'half_height':3,'material':'white'},"
    "{'type':'octahedron','radius':1.25,'material':'mirror'},"
    "{'type':'plane','normal':[0,3,4],'offset':10,'material':'white'},"
    "{'type':'mandelbulb','power':8,'iterations':4,'bailout':256,'material':'white'}]}";

static char file_name[] = "/tmp/stepwise-scene-XXXXXX.json";
static char error[SCENE_ERROR_SIZE];
static struct scene scene;

static int make_file(void **state) {
    (void)state;
    int descriptor = mkstemps(file_name, 5);
    return descriptor < 0 ? -1 : close(descriptor);
}

static int remove_file(void **state) {
    (void)state;
    return unlink(file_name);
}

static bool load_bytes(const char *bytes, size_t count, const struct scene_overrides *overrides) {
    FILE *file = fopen(file_name, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, count, file), count);
    assert_int_equal(fclose(file), 0);
    error[0] = '\0';
    return scene_load(file_name, overrides, &scene, error);
}

static bool load_json(const json_t *root, size_t flags) {
    char *text = json_dumps(root, flags | JSON_ENCODE_ANY);
    assert_non_null(text);
    bool loaded = load_bytes(text, strlen(text), NULL);
    free(text);
    return loaded;
}

// JSON in which ' stands for ", so that C strings stay readable.
static json_t *parse(const char *quoted) {
    char text[4096];
    assert_true(strlen(quoted) < sizeof text);
    strcpy(text, quoted);
    for (char *c = text; (c = strchr(c, '\'')) != NULL;)
        *c = '"';
    json_t *value = json_loads(text, JSON_DECODE_ANY, NULL);
    if (!value)
        fail_msg("not JSON: %s", text);
    return value;
}

// WHOLE with the value at `path` ("shapes[3].radius") replaced, or left out when NULL.
static json_t *edited(const char *path, const char *value) {
    json_t *at = parse(WHOLE), *root = at;
    char steps[256];
    strcpy(steps, path);
    for (char *step = strtok(steps, ".["), *next; step; step = next) {
        next = strtok(NULL, ".[");
        bool index = step[strlen(step) - 1] == ']';
        size_t i = index ? (size_t)atoi(step) : 0;
        if (next)
            at = index ? json_array_get(at, i) : json_object_get(at, step);
        else if (!value)
            assert_int_equal(index ? json_array_remove(at, i) : json_object_del(at, step), 0);
        else if (index)
            assert_int_equal(json_array_set_new(at, i, parse(value)), 0);
        else
            assert_int_equal(json_object_set_new(at, step, parse(value)), 0);
    }
    return root;
}

// The edit is refused, in one line: file, path of the value, then `message` (NULL: any).
static void refused(const char *path, const char *value, const char *at, const char *message) {
    json_t *root = edited(path, value);
    bool loaded = load_json(root, JSON_COMPACT);
    json_decref(root);
    if (loaded) {
        scene_free(&scene);
        fail_msg("%s := %s was accepted", path, value ? value : "nothing");
    }
    char expected[SCENE_ERROR_SIZE];
    snprintf(expected, sizeof expected, "%s: $.%s: %s", file_name, at ? at : path,
             message ? message : "");
    if (message)
        assert_string_equal(error, expected);
    else if (strncmp(error, expected, strlen(expected)) != 0)
        fail_msg("%s := %s gave \"%s\", not \"%s...\"", path, value ? value : "nothing", error,
                 expected);
    assert_null(strchr(error, '\n'));
    assert_null(scene.model.shapes); // nothing is left to free
}

static bool accepted(const char *path, const char *value) {
    json_t *root = edited(path, value);
    bool loaded = load_json(root, JSON_COMPACT);
    json_decref(root);
    return loaded;
}

static void limits_are_refused(void **state) {
    (void)state;
    static const struct {
        const char *path, *value, *at, *message;
    } cases[] = {
        {"camera.vertical_fov_degrees", "0.99", NULL, "0.99 is not in 1 to 170 degrees"},
        {"camera.vertical_fov_degrees", "171", NULL, "171 is not in 1 to 170 degrees"},
        {"camera.look_at", "[1,2,3]", NULL, "is the camera's position; it must differ from it"},
        {"camera.up", "[0,0,0]", NULL, "is zero or parallel to the direction of view"},
        {"camera.up", "[6,-6,12]", NULL, "is zero or parallel to the direction of view"},
        {"camera.up", "[-3,3,-6]", NULL, "is zero or parallel to the direction of view"},
        {"camera.position", "[1,2]", NULL, "2 numbers where exactly 3 are required"},
        {"camera.position", "[1,2,3,4]", NULL, "4 numbers where exactly 3 are required"},
        {"camera.position[1]", "1.5e9", NULL,
         "1.5e+09 is beyond 1e+09, the largest number there is"},
        {"light.shadows", "'Soft'", NULL, "\"Soft\" is not one of \"soft\", \"hard\", \"none\""},
        {"light.shadow_strength", "0", NULL, "0 is not > 0"},
        {"light.shadow_strength", "-3", NULL, "-3 is not > 0"},
        {"light.emission[2]", "-0.5", NULL, "-0.5 is not >= 0"},
        {"background[0]", "-1", NULL, "-1 is not >= 0"},
        {"fog", "-1e-6", NULL, "-1e-06 is not >= 0"},
        {"march.max_steps", "0", NULL, "0 is not >= 1"},
        {"march.max_steps", "2.5", NULL, "2.5 is not a whole number"},
        {"march.max_steps", "1e300", NULL, "1e+300 is beyond 1000000000, the largest there is"},
        {"march.max_bounces", "257", NULL, "257 is beyond 256, the largest there is"},
        {"march.hit_distance", "0", NULL, "0 is not > 0"},
        {"march.hit_distance", "-1e-6", NULL, "-1e-06 is not > 0"},
        {"march.bounds_radius", "0", NULL, "0 is not > 0"},
        {"march.max_bounces", "-1", NULL, "-1 is not >= 0"},
        {"march.max_bounces", "0.5", NULL, "0.5 is not a whole number"},
        {"march.normal_step", "0", NULL, "0 is not > 0"},
        {"march.surface_offset", "0", NULL, "0 is not > 0"},
        {"materials.white.color[1]", "-0.1", NULL, "-0.1 is not >= 0"},
        {"materials.white.reflectivity", "-0.1", NULL, "-0.1 is not in 0 to 1"},
        {"materials.white.reflectivity", "1.1", NULL, "1.1 is not in 0 to 1"},
        {"materials.white.shininess", "0", NULL, "0 is not > 0"},
        {"materials.white", NULL, "shapes[1].material", "\"white\" is not defined in $.materials"},
        {"shapes[4].material", "'gold'", NULL, "\"gold\" is not defined in $.materials"},
        {"shapes", "[]", NULL, "0 shapes; 1 to 4096 are allowed"},
        {"shapes[2].type", "'donut'", NULL,
         "\"donut\" is not a shape; there are sphere, box, torus, cone, octahedron, plane, "
         "mandelbulb"},
        {"shapes[0].radius", "0", NULL, "0 is not > 0"},
        {"shapes[0].radius", "-1", NULL, "-1 is not > 0"},
        {"shapes[0].repeat[1]", "-2", NULL, "-2 is not >= 0"},
        {"shapes[0].repeat[1]", "1e-40", NULL, "1e-40 is neither 0 nor a cell of at least 1e-09"},
        {"shapes[1].half_size[2]", "0", NULL, "0 is not > 0"},
        {"shapes[1].rounding", "-0.1", NULL, "-0.1 is not >= 0"},
        {"shapes[1].rounding", "1e-12", NULL, "1e-12 is neither 0 nor a radius of at least 1e-09"},
        {"shapes[0].rounding", "0.1", NULL,
         "unknown key; known here: type, material, position, rotation_degrees, repeat, path, "
         "radius"},
        {"shapes[1].type", "'rounded box'", NULL,
         "\"rounded box\" is not a shape; there are sphere, box, torus, cone, octahedron, plane, "
         "mandelbulb"},
        {"shapes[2].major_radius", "0", NULL, "0 is not > 0"},
        {"shapes[2].minor_radius", "-0.5", NULL, "-0.5 is not > 0"},
        {"shapes[3].bottom_radius", "0", NULL, "0 is not > 0"},
        {"shapes[3].top_radius", "0", NULL, "0 is not > 0"},
        {"shapes[3].half_height", "-3", NULL, "-3 is not > 0"},
        {"shapes[3].radius", "1", NULL,
         "unknown key; known here: type, material, position, rotation_degrees, repeat, path, "
         "bottom_radius, top_radius, half_height"},
        {"shapes[4].radius", "0", NULL, "0 is not > 0"},
        {"shapes[5].normal", "[0,0,0]", NULL, "is zero; a direction is required"},
        {"shapes[5].normal", "[0,1e-300,0]", NULL, "is zero; a direction is required"},
        {"shapes[6].power", "7", NULL, "7 is not 8, the only power there is a map for"},
        {"shapes[6].iterations", "0", NULL, "0 is not >= 1"},
        {"shapes[6].iterations", "1001", NULL, "1001 is beyond 1000, the largest there is"},
        {"shapes[6].iterations", "1.5", NULL, "1.5 is not a whole number"},
        {"shapes[0].path.type", "'spiral'", NULL, "\"spiral\" is not one of \"circle\", \"line\""},
        {"shapes[0].path.period", "0", NULL, "0 is not > 0"},
        {"shapes[0].path.period", "-1", NULL, "-1 is not > 0"},
        {"shapes[0].path.axis", "[0,0,0]", NULL, "is zero; a direction is required"},
        {"shapes[0].path.centre", "[1,2,-70]", NULL,
         "the shape's position is on the circle's axis; it would not move"},
        {"shapes[0].path.centre", "[1e9,0,0]", NULL,
         "the circle leads beyond 1e+09, the largest number there is"},
        {"shapes[0].path.to", "[1,1,1]", NULL,
         "unknown key; known here: type, period, centre, axis"},
        {"shapes[1].path.axis", "[1,1,1]", NULL, "unknown key; known here: type, period, to"},
        {"shapes[1].path.to", "[0,-0.0,0]", NULL,
         "is the shape's position; it must differ from it"},
        {"shapes[6].bailout", "3.9", NULL, "3.9 is not in 4 to 10000"},
        {"shapes[6].bailout", "10001", NULL, "10001 is not in 4 to 10000"},
    };
    for (size_t i = 0; i < COUNT(cases); i++)
        refused(cases[i].path, cases[i].value, cases[i].at, cases[i].message);
}

static void limits_themselves_are_accepted(void **state) {
    (void)state;
    static const char *const cases[][2] = {
        {"camera.vertical_fov_degrees", "1"},
        {"camera.vertical_fov_degrees", "170"},
        {"light.emission", "[0,0,0]"},
        {"light.shadows", "'none'"},
        {"light.shadows", "'soft'"},
        {"fog", "0"},
        {"march.max_steps", "1"},
        {"march.max_steps", "7.0"},
        {"march.max_bounces", "0"},
        {"materials.white.reflectivity", "1"},
        {"materials.white.color", "[0,0,0]"},
        {"shapes[0].radius", "1e-9"},
        {"shapes[0].radius", "1e9"},
        {"shapes[5].offset", "-1e9"},
        {"shapes[6].iterations", "1"},
        {"shapes[6].bailout", "4"},
        {"shapes[6].bailout", "10000"},
        {"shapes[0].position", NULL},
        {"shapes[0].rotation_degrees", NULL},
        {"shapes[0].repeat", NULL},
        {"shapes[0].path", NULL},
        {"shapes[0].path.period", "1e-9"},
        {"shapes[1].path.to", "[0,1e-300,0]"},
        {"shapes[1].path.to", "[1e9,-1e9,1e9]"},
        {"shapes[0].rotation_degrees", "[0,0,0]"},
        {"shapes[0].repeat", "[0,0,0]"},
        {"shapes[1].rounding", NULL},
        {"shapes[1].rounding", "0"},
        {"shapes[1].rounding", "1e-9"},
        {"shapes[1].rounding", "1e9"},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        if (!accepted(cases[i][0], cases[i][1]))
            fail_msg("%s := %s was refused: %s", cases[i][0], cases[i][1], error);
        scene_free(&scene);
    }
}

enum { MOST_PATHS = 256 };

struct paths {
    char path[MOST_PATHS][96];
    json_type type[MOST_PATHS];
    size_t count;
};

static void collect(json_t *value, const char *path, struct paths *paths) {
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

static void collect_whole(struct paths *paths) {
    json_t *root = parse(WHOLE);
    paths->count = 0;
    collect(root, "", paths);
    json_decref(root);
    assert_true(paths->count > 100);
}

static bool ends_in(const char *text, const char *ending) {
    size_t length = strlen(text), end = strlen(ending);
    return length >= end && strcmp(text + length - end, ending) == 0;
}

// Every value left out is missed at its path, a mistyped one refused there, and so is a number
// beyond the largest; an unknown key is refused in every object.
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

static void counts_of_shapes(void **state) {
    (void)state;
    for (int count = 4095; count <= 5000; count += count < 4097 ? 1 : 903) {
        json_t *root = edited("shapes", "[]");
        for (int i = 0; i < count; i++)
            json_array_append_new(json_object_get(root, "shapes"),
                                  parse("{'type':'sphere','radius':1,'material':'white'}"));
        bool loaded = load_json(root, JSON_COMPACT);
        json_decref(root);
        assert_int_equal(loaded, count <= 4096);
        if (loaded) {
            assert_int_equal(scene.model.shape_count, count);
            scene_free(&scene);
        } else {
            char expected[256];
            snprintf(expected, sizeof expected, "%s: $.shapes: %d shapes; 1 to 4096 are allowed",
                     file_name, count);
            assert_string_equal(error, expected);
        }
    }
}

// Broken JSON is refused with file:line:column.
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
    static char deep[10000]; // no stack overflow
    memset(deep, '[', sizeof deep);
    assert_false(load_bytes(deep, sizeof deep, NULL));
    assert_non_null(strstr(error, ".json:1:"));
    assert_false(load_bytes("[1, 2]", 6, NULL));
    assert_non_null(strstr(error, ".json: $: an array where an object is required"));
}

// Text of the file that an error repeats cannot break the one line, nor steer a terminal.
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

static bool near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) {
        print_error("%.17g is not %.17g within %g\n", a, b, tolerance);
        return false;
    }
    return true;
}

static void values_arrive(void **state) {
    (void)state;
    json_t *root = parse(WHOLE);
    assert_true(load_json(root, 0));
    json_decref(root);
    const struct model *m = &scene.model;
    const struct view *v = &scene.view;
    static const enum shape_type types[] = {SHAPE_SPHERE,    SHAPE_ROUNDED_BOX, SHAPE_TORUS,
                                            SHAPE_CONE,      SHAPE_OCTAHEDRON,  SHAPE_PLANE,
                                            SHAPE_MANDELBULB};
    assert_int_equal(m->shape_count, 7);
    assert_int_equal(m->material_count, 2);
    for (int i = 0; i < 7; i++) {
        assert_int_equal(m->shapes[i].type, types[i]);
        assert_int_equal(m->features.count[types[i]], 1);
        assert_int_equal(m->shapes[i].material, i == 0 || i == 4);
    }
    const struct shape *s = m->shapes;
    assert_memory_equal(s[0].position, ((double[]){1, 2, 3}), sizeof s->position);
    assert_memory_equal(s[0].rotation_degrees, ((double[]){10, 20, 30}), sizeof s->position);
    assert_memory_equal(s[0].repeat, ((double[]){4, 0, 5}), sizeof s->position);
    assert_int_equal(s[0].path.type, PATH_CIRCLE);
    assert_memory_equal(s[0].path.axis, ((double[]){0, 0, 1}), sizeof s->position);
    assert_memory_equal(s[0].path.foot, ((double[]){0, 1, 3}), sizeof s->position);
    assert_int_equal(s[1].path.type, PATH_LINE);
    assert_memory_equal(s[1].path.to, ((double[]){4, -8, 0.5}), sizeof s->position);
    assert_true(s[0].path.period == 8 && s[1].path.period == 2);
    for (int i = 2; i < 7; i++)
        assert_int_equal(s[i].path.type, PATH_NONE);
    for (int i = 1; i < 7; i++) { // left out: zero
        assert_memory_equal(s[i].position, ((double[]){0, 0, 0}), sizeof s->position);
        assert_memory_equal(s[i].rotation_degrees, ((double[]){0, 0, 0}), sizeof s->position);
        assert_memory_equal(s[i].repeat, ((double[]){0, 0, 0}), sizeof s->position);
    }
    assert_true(s[0].sphere.radius == 1.5 && s[4].octahedron.radius == 1.25);
    assert_memory_equal(s[1].box.half_size, ((double[]){1, 2, 3}), sizeof s->position);
    assert_true(s[1].box.rounding == 0.25);
    assert_true(s[2].torus.major_radius == 2 && s[2].torus.minor_radius == 0.5);
    assert_true(s[3].cone.bottom_radius == 2 && s[3].cone.top_radius == 1);
    assert_true(s[3].cone.half_height == 3);
    assert_true(s[6].mandelbulb.power == 8 && s[6].mandelbulb.bailout == 256);
    assert_int_equal(s[6].mandelbulb.iterations, 4);
    // n·p = 10 with n = (0, 3, 4): the plane stays, the normal is made unit
    assert_true(near(s[5].plane.normal[0], 0, 0) && near(s[5].plane.normal[1], 0.6, 1e-15));
    assert_true(near(s[5].plane.normal[2], 0.8, 1e-15) && near(s[5].plane.offset, 2, 1e-15));
    assert_memory_equal(m->materials[0].color, ((double[]){1, 0.9, 0.8}), sizeof s->position);
    assert_true(m->materials[1].reflectivity == 0.5 && m->materials[1].shininess == 20);
    assert_memory_equal(m->background, ((double[]){0.1, 0.2, 0.3}), sizeof m->background);
    assert_true(m->fog == 1e-5 && m->shadows == SHADOWS_HARD && m->shadow_strength == 3);
    assert_true(m->march.max_steps == 300 && m->march.hit_distance == 1e-6);
    assert_true(m->march.bounds_radius == 100 && m->march.max_bounces == 2);
    assert_true(m->march.normal_step == 1e-4 && m->march.surface_offset == 1e-3);
    assert_memory_equal(v->position, ((double[]){1, 2, 3}), sizeof v->position);
    assert_memory_equal(v->light_position, ((double[]){5, 6, 7}), sizeof v->position);
    assert_memory_equal(v->light_emission, ((double[]){8, 9, 10}), sizeof v->position);
    assert_true(near(v->tan_half_fov, 0.36397023426620234, 1e-15)); // tan 20°
    assert_memory_equal(scene.name, file_name + 5,
                        strlen(file_name + 5) - 5); // no folder, no ending
    assert_string_equal(shape_type_name(SHAPE_CONE), "cone");
    assert_string_equal(shadows_name(SHADOWS_SOFT), "soft");
    scene_free(&scene);
}

static void cross(const double a[3], const double b[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double random_number(uint64_t *seed) { // -1 to 1, the same in every run (Knuth's MMIX LCG)
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(int64_t)*seed / 9223372036854775808.0;
}

// Orthonormal, forward to look_at, right = normalize(up × forward): x grows to the right.
static void camera_frames(void **state) {
    (void)state;
    uint64_t seed = 1;
    for (int i = 0; i < 200; i++) {
        double p[3], q[3], up[3], length = pow(10, 4 * random_number(&seed)), c[3];
        for (int k = 0; k < 3; k++) {
            p[k] = 10 * random_number(&seed);
            q[k] = p[k] + length * random_number(&seed);
            up[k] = random_number(&seed);
        }
        json_t *root = parse(WHOLE);
        json_t *camera = json_pack("{s:[f,f,f], s:[f,f,f], s:[f,f,f], s:f}", "position", p[0], p[1],
                                   p[2], "look_at", q[0], q[1], q[2], "up", up[0], up[1], up[2],
                                   "vertical_fov_degrees", 30.);
        json_object_set_new(root, "camera", camera);
        assert_true(load_json(root, JSON_REAL_PRECISION(17)));
        json_decref(root);
        const struct view *v = &scene.view;
        assert_true(near(dot(v->right, v->right), 1, 1e-14) && near(dot(v->up, v->up), 1, 1e-12));
        assert_true(near(dot(v->forward, v->forward), 1, 1e-14));
        assert_true(near(dot(v->right, v->up), 0, 1e-12) &&
                    near(dot(v->right, v->forward), 0, 1e-12));
        cross(v->forward, v->right,
              c); // the frame is (right, up, forward) with up = forward × right
        for (int k = 0; k < 3; k++)
            assert_true(near(v->up[k], c[k], 1e-15));
        cross(up, v->forward, c);
        double size = sqrt(dot(c, c));
        for (int k = 0; k < 3; k++)
            assert_true(near(v->right[k], c[k] / size, 1e-10));
        double d[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
        assert_true(near(dot(d, v->forward), sqrt(dot(d, d)), 1e-12 * length));
        scene_free(&scene);
    }
}

// The square of 3e-161 is denormal: a length from it would be off in the third digit.
static void a_tiny_step_to_look_at_is_still_a_direction(void **state) {
    (void)state;
    for (int e = 0; e >= -300; e -= 20) {
        json_t *root = parse(WHOLE);
        json_t *camera = json_pack("{s:[i,i,i], s:[f,i,f], s:[i,i,i], s:f}", "position", 0, 0, 0,
                                   "look_at", 3 * pow(10, e), 0, 4 * pow(10, e), "up", 0, 1, 0,
                                   "vertical_fov_degrees", 30.);
        json_object_set_new(root, "camera", camera);
        assert_true(load_json(root, JSON_REAL_PRECISION(17)));
        json_decref(root);
        const double digits = 1e-15;
        assert_true(near(scene.view.forward[0], 0.6, digits));
        assert_true(near(scene.view.forward[2], 0.8, digits));
        scene_free(&scene);
    }
}

// Quarters of a period by hand; between them, a rotation and a cosine of our own; before time 0 as after it.
static void shapes_follow_their_paths(void **state) {
    (void)state;
    json_t *root = parse(WHOLE);
    assert_true(load_json(root, 0));
    json_decref(root);
    const struct model *still = &scene.model;
    struct shape shapes[7];
    struct model moved = *still;
    moved.shapes = shapes;
    // seconds; of a turn about (0, 1, z), where the test looks at it; of the way to (4, −8, 0.5)
    static const double by_hand[][7] = {
        {0, 1, 2, 3, 0, 0, 0},    {1, 0, 0, 0, 4, -8, 0.5},    {2, -1, 2, 3, 0, 0, 0},
        {4, -1, 0, 3, 0, 0, 0},   {6, 1, 0, 3, 0, 0, 0},       {-2, 1, 0, 3, 0, 0, 0},
        {802, -1, 2, 3, 0, 0, 0}, {0.5, 0, 0, 0, 2, -4, 0.25},
    };
    for (size_t i = 0; i < COUNT(by_hand); i++) {
        const double *row = by_hand[i];
        model_move(still, row[0], &moved);
        if (row[3] != 0)
            assert_memory_equal(shapes[0].position, &row[1], sizeof shapes->position);
        assert_memory_equal(shapes[1].position, &row[4], sizeof shapes->position);
        for (int k = 2; k < 7; k++) // has none
            assert_memory_equal(&shapes[k], &still->shapes[k], sizeof *shapes);
        assert_memory_equal(&shapes[0].sphere, &still->shapes[0].sphere, sizeof shapes->sphere);
    }
    for (double t = -3; t < 9; t += 0.37) {
        model_move(still, t, &moved);
        double a = M_PI * t / 4, part = 0.5 - 0.5 * cos(M_PI * t);
        const double *p = shapes[0].position;
        assert_true(near(p[0], cos(a) - sin(a), 1e-14));
        assert_true(near(p[1], 1 + sin(a) + cos(a), 1e-14) && near(p[2], 3, 0));
        p = shapes[1].position;
        assert_true(near(p[0], 4 * part, 1e-14) && near(p[1], -8 * part, 1e-14));
    }
    assert_true(still->features.motion);
    scene_free(&scene);
    root = edited("shapes[0].path", NULL);
    json_object_del(json_array_get(json_object_get(root, "shapes"), 1), "path");
    assert_true(load_json(root, 0));
    json_decref(root);
    assert_false(scene.model.features.motion);
    scene_free(&scene);
}

// About a slanted axis that does not go through the origin: distance to the axis and place along it stay.
static void a_circle_keeps_its_distance(void **state) {
    (void)state;
    json_t *root = edited("shapes[0].path.axis", "[1,-2,2]");
    assert_true(load_json(root, 0));
    json_decref(root);
    const double axis[3] = {1 / 3., -2 / 3., 2 / 3.}, centre[3] = {0, 1, 3};
    struct shape shapes[7];
    struct model moved = scene.model;
    moved.shapes = shapes;
    double along = -1 / 3., distance = sqrt(17 / 9.); // (1, 1, 0)·axis; its rest: 2 − 1/9
    double turned[3], before[3] = {1, 1, 0};
    for (double t = 0; t < 8; t += 0.5) {
        model_move(&scene.model, t, &moved);
        double from[3], off[3], ahead[3];
        for (int i = 0; i < 3; i++)
            from[i] = shapes[0].position[i] - centre[i];
        assert_true(near(dot(from, axis), along, 1e-14));
        for (int i = 0; i < 3; i++)
            off[i] = from[i] - along * axis[i];
        assert_true(near(sqrt(dot(off, off)), distance, 1e-14));
        for (int i = 0; i < 3; i++)
            turned[i] = from[i] - before[i];
        cross(axis, off, ahead); // by the right hand: onward is along axis × off
        assert_true(t == 0 || dot(turned, ahead) > 0);
        memcpy(before, from, sizeof before);
    }
    scene_free(&scene);
}

static void features_are_found(void **state) {
    (void)state;
    static const struct {
        const char *path, *value;
        bool rotation, repetition, mirrors, fog;
    } cases[] = {
        {"fog", "1e-5", true, true, true, true},
        {"fog", "0", true, true, true, false},
        {"shapes[0].rotation_degrees", "[0,0,0]", false, true, true, true},
        {"shapes[0].rotation_degrees", "[0,0,-1e-9]", true, true, true, true},
        {"shapes[0].repeat", "[0,0,0]", true, false, true, true},
        {"shapes[0].repeat", NULL, true, false, true, true},
        {"march.max_bounces", "0", true, true, false, true},
        {"materials.mirror.reflectivity", "0", true, true, false, true},
        {"materials.unused", "{'color':[1,1,1],'reflectivity':1,'shininess':1}", true, true, true,
         true},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        assert_true(accepted(cases[i].path, cases[i].value));
        const struct features *f = &scene.model.features;
        if (f->rotation != cases[i].rotation || f->repetition != cases[i].repetition ||
            f->mirrors != cases[i].mirrors || f->fog != cases[i].fog)
            fail_msg("%s := %s: rotation %d, repetition %d, mirrors %d, fog %d", cases[i].path,
                     cases[i].value, f->rotation, f->repetition, f->mirrors, f->fog);
        scene_free(&scene);
    }
    // a mirror that no shape is made of is no feature
    json_t *root = edited("shapes[4]", NULL);
    json_array_remove(json_object_get(root, "shapes"), 0);
    assert_true(load_json(root, 0));
    json_decref(root);
    assert_false(scene.model.features.mirrors);
    assert_int_equal(scene.model.features.count[SHAPE_SPHERE], 0);
    scene_free(&scene);
}

// What is not rounded is of the plain type, so that no phase pays for what it does not have.
static void a_box_without_rounding_is_plain(void **state) {
    (void)state;
    static const char *const none[] = {NULL, "0", "0.0", "-0.0"};
    for (size_t i = 0; i < COUNT(none); i++) {
        assert_true(accepted("shapes[1].rounding", none[i]));
        assert_int_equal(scene.model.shapes[1].type, SHAPE_BOX);
        assert_true(scene.model.shapes[1].box.rounding == 0);
        assert_int_equal(scene.model.features.count[SHAPE_BOX], 1);
        assert_int_equal(scene.model.features.count[SHAPE_ROUNDED_BOX], 0);
        scene_free(&scene);
    }
}

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

static void hash_follows_content(void **state) {
    (void)state;
    char plain[17], other[17];
    json_t *root = parse(WHOLE), *reversed = json_object();
    hash_of(root, JSON_COMPACT, NULL, plain);
    hash_of(root, JSON_INDENT(4) | JSON_SORT_KEYS, NULL, other);
    assert_string_equal(plain, other); // white space and order of keys say nothing
    static const char *const keys[] = {"shapes",     "materials", "march", "fog",
                                       "background", "light",     "camera"};
    for (size_t i = 0; i < COUNT(keys); i++)
        json_object_set(reversed, keys[i], json_object_get(root, keys[i]));
    hash_of(reversed, 0, NULL, other);
    assert_string_equal(plain, other);
    json_decref(reversed);

    static const struct {
        struct scene_overrides overrides;
        bool same;
    } cases[] = {{{0, 0}, true},     {{1e-6, 0}, true}, {{0, 300}, true},    {{1e-6, 300}, true},
                 {{2e-6, 0}, false}, {{0, 301}, false}, {{2e-6, 301}, false}};
    for (size_t i = 0; i < COUNT(cases); i++) {
        hash_of(root, 0, &cases[i].overrides, other);
        assert_int_equal(strcmp(plain, other) == 0, cases[i].same);
    }
    json_decref(root);

    static struct paths paths; // every number of the file counts
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

static void overrides_replace(void **state) {
    (void)state;
    json_t *root = parse(WHOLE);
    char *text = json_dumps(root, 0);
    json_decref(root);
    assert_true(load_bytes(text, strlen(text), &(struct scene_overrides){0.25, 7}));
    free(text);
    assert_true(scene.model.march.hit_distance == 0.25 && scene.model.march.max_steps == 7);
    scene_free(&scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(limits_are_refused),
        cmocka_unit_test(limits_themselves_are_accepted),
        cmocka_unit_test(every_value_is_checked),
        cmocka_unit_test(counts_of_shapes),
        cmocka_unit_test(broken_json),
        cmocka_unit_test(errors_are_one_printable_line),
        cmocka_unit_test(long_names_stay_in_their_buffers),
        cmocka_unit_test(unreadable_files),
        cmocka_unit_test(values_arrive),
        cmocka_unit_test(camera_frames),
        cmocka_unit_test(a_tiny_step_to_look_at_is_still_a_direction),
        cmocka_unit_test(shapes_follow_their_paths),
        cmocka_unit_test(a_circle_keeps_its_distance),
        cmocka_unit_test(features_are_found),
        cmocka_unit_test(a_box_without_rounding_is_plain),
        cmocka_unit_test(hash_follows_content),
        cmocka_unit_test(overrides_replace),
    };
    return cmocka_run_group_tests_name("scene", tests, make_file, remove_file);
}
