// Reads a scene. jansson parses the file: it reports line and column of broken JSON and refuses
// duplicate keys. The functions here check every value.
#include "scene/scene.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene/internal.h"
#include "scene/vector.h"
#include "scene/words.h"

// Bounces are limited because phases recurse: two facing mirrors would exhaust the stack. Each bounce
// adds at most a tenth of the one before, so that 16 already reach double precision.
enum { MAX_STEPS = 1000000000, MAX_BOUNCES = 256 };

static const char *const SHADOW_NAMES[] = {"none", "hard", "soft", "ideal"};

enum { SHADOWS_COUNT = sizeof SHADOW_NAMES / sizeof *SHADOW_NAMES };

static void read_camera(struct reader *r, json_t *root, struct view *view, struct flight *flight) {
    json_t *camera = reader_member(r, root, "camera", JSON_OBJECT, "an object");
    if (!camera)
        return;
    size_t back = reader_enter(r, "camera");
    static const char *const keys[] = {"position", "look_at", "up", "vertical_fov_degrees",
                                       "path",     NULL};
    reader_only_keys(r, camera, keys);
    reader_vector(r, camera, "position", ANY, view->position);
    reader_vector(r, camera, "look_at", ANY, flight->look_at);
    reader_vector(r, camera, "up", ANY, flight->up);
    double fov = reader_number(r, camera, "vertical_fov_degrees", FIELD_OF_VIEW);
    if (!r->failed) {
        enum aim aim = view_aim(view, flight->look_at, flight->up);
        if (aim == AIM_AT_ITSELF)
            reader_fail(r, "look_at", "is the camera's position; it must differ from it");
        else if (aim == AIM_ALONG_UP)
            reader_fail(r, "up", "is zero or parallel to the direction of view");
        view->tan_half_fov = tan(fov * (M_PI / 180.0) / 2.0);
    }
    if (json_object_get(camera, "path") && !r->failed)
        scene_read_path(r, camera, view->position, &flight->path);
    reader_leave(r, back);
}

static void read_light(struct reader *r, json_t *root, struct scene *scene) {
    json_t *light = reader_member(r, root, "light", JSON_OBJECT, "an object");
    if (!light)
        return;
    size_t back = reader_enter(r, "light");
    static const char *const keys[] = {"position", "emission", "shadows", "shadow_strength", NULL};
    reader_only_keys(r, light, keys);
    reader_vector(r, light, "position", ANY, scene->view.light_position);
    reader_vector(r, light, "emission", NOT_NEGATIVE, scene->view.light_emission);
    json_t *shadows = reader_member(r, light, "shadows", JSON_STRING,
                                    "\"soft\", \"ideal\", \"hard\" or \"none\"");
    if (shadows) {
        const char *text = json_string_value(shadows);
        int found;
        if (!word_among(text, SHADOW_NAMES, SHADOWS_COUNT, &found))
            reader_fail(r, "shadows",
                        "\"%.80s\" is not one of \"soft\", \"ideal\", \"hard\", \"none\"", text);
        else
            scene->model.shadows = (enum shadows)found;
    }
    scene->model.shadow_strength = reader_number(r, light, "shadow_strength", POSITIVE);
    reader_leave(r, back);
}

static void read_march(struct reader *r, json_t *root, struct limits *march) {
    json_t *object = reader_member(r, root, "march", JSON_OBJECT, "an object");
    if (!object)
        return;
    size_t back = reader_enter(r, "march");
    static const char *const keys[] = {"max_steps",   "hit_distance", "bounds_radius",
                                       "max_bounces", "normal_step",  "surface_offset",
                                       NULL};
    reader_only_keys(r, object, keys);
    march->max_steps = reader_whole(r, object, "max_steps", 1, MAX_STEPS);
    march->hit_distance = reader_number(r, object, "hit_distance", POSITIVE);
    march->bounds_radius = reader_number(r, object, "bounds_radius", POSITIVE);
    march->max_bounces = reader_whole(r, object, "max_bounces", 0, MAX_BOUNCES);
    march->normal_step = reader_number(r, object, "normal_step", POSITIVE);
    march->surface_offset = reader_number(r, object, "surface_offset", POSITIVE);
    reader_leave(r, back);
}

static void read_materials(struct reader *r, json_t *root, struct model *model) {
    json_t *materials = reader_member(r, root, "materials", JSON_OBJECT, "an object");
    if (!materials)
        return;
    model->materials = reader_allocate(r, json_object_size(materials), sizeof *model->materials);
    size_t back = reader_enter(r, "materials");
    const char *name;
    json_t *object;
    json_object_foreach(materials, name, object) {
        if (r->failed)
            break;
        if (!json_is_object(object)) {
            char quoted[96];
            snprintf(quoted, sizeof quoted, "%.80s", name);
            reader_fail(r, quoted, "%s where an object is required", reader_kind(object));
            break;
        }
        size_t inner = reader_enter(r, name);
        static const char *const keys[] = {"color", "reflectivity", "shininess", NULL};
        reader_only_keys(r, object, keys);
        struct material *material = &model->materials[model->material_count++];
        reader_vector(r, object, "color", NOT_NEGATIVE, material->color);
        material->reflectivity = reader_number(r, object, "reflectivity", UNIT);
        material->shininess = reader_number(r, object, "shininess", POSITIVE);
        reader_leave(r, inner);
    }
    reader_leave(r, back);
}

static void find_features(struct model *model) {
    struct features *f = &model->features;
    *f = (struct features){.fog = model->fog > 0};
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        f->count[shape->type]++;
        f->motion = f->motion || shape->path.type != PATH_NONE;
        for (int k = 0; k < 3; k++) {
            f->rotation = f->rotation || shape->rotation_degrees[k] != 0;
            f->repetition = f->repetition || shape->repeat[k] > 0;
        }
        f->mirrors = f->mirrors || (model->materials[shape->material].reflectivity > 0 &&
                                    model->march.max_bounces > 0);
    }
    f->groups = f->count[SHAPE_GROUP];
    for (int i = 0; i < model->node_count; i++) {
        const struct node *node = &model->nodes[i];
        const struct material *material = &model->materials[node->shape.material];
        f->blends = f->blends || node->blend > 0;
        f->displacements = f->displacements || node->amplitude > 0;
        f->twists = f->twists || node->twist != 0;
        f->motion = f->motion || node->shape.path.type != PATH_NONE;
        f->mirrors = f->mirrors || (material->reflectivity > 0 && model->march.max_bounces > 0);
    }
}

static void name_scene(const char *path, char name[64]) {
    const char *slash = strrchr(path, '/');
    snprintf(name, 64, "%s", slash ? slash + 1 : path);
    char *dot = strrchr(name, '.');
    if (dot && dot != name)
        *dot = '\0';
    for (char *c = name; *c; c++) // JSON is UTF-8, and the name may be cut within a character
        if ((unsigned char)*c >= 0x80 || (unsigned char)*c < ' ')
            *c = '?';
}

bool scene_load(const char *path, const struct scene_overrides *overrides, struct scene *scene,
                char *error) {
    memset(scene, 0, sizeof *scene);
    struct reader reader = {.file = path, .path = "$", .error = error};
    struct reader *r = &reader;
    FILE *file = fopen(path, "rb");
    if (!file) {
        snprintf(error, SCENE_ERROR_SIZE, "%s: cannot read the scene: %s", path, strerror(errno));
        return false;
    }
    json_error_t broken;
    json_t *root = json_loadf(file, JSON_REJECT_DUPLICATES, &broken);
    bool read_error = ferror(file) != 0;
    int reason = errno;
    fclose(file);
    if (!root) {
        if (read_error)
            snprintf(error, SCENE_ERROR_SIZE, "%s: cannot read the scene: %s", path,
                     strerror(reason));
        else
            snprintf(error, SCENE_ERROR_SIZE, "%s:%d:%d: %s", path, broken.line, broken.column,
                     broken.text);
        reader_one_line(error);
        return false;
    }
    struct model *model = &scene->model;
    if (!json_is_object(root))
        reader_fail(r, NULL, "%s where an object is required", reader_kind(root));
    else {
        static const char *const keys[] = {"camera", "light",     "background", "fog",
                                           "march",  "materials", "shapes",     NULL};
        reader_only_keys(r, root, keys);
        read_camera(r, root, &scene->view, &scene->flight);
        read_light(r, root, scene);
        reader_vector(r, root, "background", NOT_NEGATIVE, model->background);
        model->fog = reader_number(r, root, "fog", NOT_NEGATIVE);
        read_march(r, root, &model->march);
        read_materials(r, root, model);
        scene_read_shapes(r, root, model);
    }
    if (!r->failed) {
        if (overrides && overrides->hit_distance > 0)
            model->march.hit_distance = overrides->hit_distance;
        if (overrides && overrides->max_steps > 0)
            model->march.max_steps = overrides->max_steps;
        find_features(model);
        name_scene(path, scene->name);
        if (!scene_hash(root, &model->march, scene->hash))
            reader_fail(r, NULL, "out of memory");
    }
    json_decref(root);
    if (r->failed)
        scene_free(scene);
    return !r->failed;
}

void scene_free(struct scene *scene) {
    free(scene->model.shapes);
    free(scene->model.nodes);
    free(scene->model.materials);
    memset(scene, 0, sizeof *scene);
}
