// A scene that uses every key of the format, edited and loaded from a temporary file. Each program of tests/c/scene
// runs with make_file() and remove_file() as set-up and tear-down.
#pragma once

#include "tests/c/testing.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "scene/scene.h"

static const char WHOLE[] =
    "{'camera':{'position':[1,2,3],'look_at':[4,-1,9],'up':[0.1,1,0.2],'vertical_fov_degrees':40,"
    "'path':{'type':'line','to':[3,0,5],'period':4}},"
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
    "{'type':'mandelbulb','power':8,'iterations':4,'bailout':256,'material':'white'},"
    "{'type':'mandelbox','scale':-1.5,'fold_limit':1,'minimum_radius':0.5,'fixed_radius':2,"
    "'iterations':16,'material':'white'},"
    "{'type':'group','operation':'difference','blend':0.2,'position':[0,1,9],'shapes':["
    "{'type':'box','half_size':[1,1,1],'material':'white','shell':0.1,'mirror':'xz'},"
    "{'type':'group','operation':'intersection','shapes':["
    "{'type':'gyroid','cell':1,'thickness':0.2,'material':'white'},"
    "{'type':'ellipsoid','radius':[1,2,3],'material':'mirror','twist':0.5,"
    "'path':{'type':'line','to':[1,0,0],'period':3}}]},"
    "{'type':'capsule','radius':0.2,'half_height':1,'material':'mirror','offset':-0.05,"
    "'displace':{'amplitude':0.01,'frequency':[1,2,3]}}]}]}";

static char file_name[] = "/tmp/stepwise-scene-XXXXXX.json";
static char error[SCENE_ERROR_SIZE];
static struct scene scene;

static inline int make_file(void **state) {
    (void)state;
    int descriptor = mkstemps(file_name, 5);
    return descriptor < 0 ? -1 : close(descriptor);
}

static inline int remove_file(void **state) {
    (void)state;
    return unlink(file_name);
}

static inline bool load_bytes(const char *bytes, size_t count,
                              const struct scene_overrides *overrides) {
    FILE *file = fopen(file_name, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, count, file), count);
    assert_int_equal(fclose(file), 0);
    error[0] = '\0';
    return scene_load(file_name, overrides, &scene, error);
}

static inline bool load_json(const json_t *root, size_t flags) {
    char *text = json_dumps(root, flags | JSON_ENCODE_ANY);
    assert_non_null(text);
    bool loaded = load_bytes(text, strlen(text), NULL);
    free(text);
    return loaded;
}

// Parses JSON in which ' stands for ", so that C strings stay readable.
static inline json_t *parse(const char *quoted) {
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

// Returns WHOLE with the value at `path` ("shapes[3].radius") replaced by `value`, or left out if `value` is NULL.
static inline json_t *edited(const char *path, const char *value) {
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

// Asserts that WHOLE, edited as by edited(), is refused with one line. The line names the file, the path `at` (NULL: the
// edited path) and `message` (NULL: any message).
static inline void refused(const char *path, const char *value, const char *at,
                           const char *message) {
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

// Loads WHOLE, edited as by edited(). Returns whether it was accepted; the caller frees the scene then.
static inline bool accepted(const char *path, const char *value) {
    json_t *root = edited(path, value);
    bool loaded = load_json(root, JSON_COMPACT);
    json_decref(root);
    return loaded;
}

// Loads WHOLE without an edit.
static inline void load_whole(void) {
    json_t *root = parse(WHOLE);
    assert_true(load_json(root, 0));
    json_decref(root);
}
