// Reading a scene: jansson parses (line and column of broken JSON, duplicate keys refused), this
// file checks every value and names the path of the one that is wrong.
#include "scene.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Far beyond any use, small enough that no float phase overflows when it squares a length twice.
static const double LARGEST = 1e9, SMALLEST = 1e-9;

// Each bounce adds at most a tenth of the one before, so 16 are below double's precision; phases
// recurse, and two facing mirrors would end on the stack's limit.
enum { MOST = 1000000000, MOST_BOUNCES = 256, MOST_ITERATIONS = 1000 };

struct reader {
    const char *file;
    char path[256];
    char *error;
    bool failed;
};

static const char *const TYPE_NAMES[SHAPE_TYPES] = {
    "sphere", "box", "torus", "cone", "octahedron", "plane", "mandelbulb", "rounded box"};
static const char *const SHADOW_NAMES[] = {"none", "hard", "soft"};

const char *shape_type_name(enum shape_type type) {
    return TYPE_NAMES[type];
}

const char *shadows_name(enum shadows shadows) {
    return SHADOW_NAMES[shadows];
}

// What a message repeats of the file cannot break its one line, nor steer a terminal.
static void keep_one_line(char *message) {
    for (char *c = message; *c; c++)
        if ((unsigned char)*c < ' ' || *c == 0x7f)
            *c = '?';
}

__attribute__((format(printf, 3, 4))) static void fail(struct reader *r, const char *key,
                                                       const char *format, ...) {
    if (r->failed)
        return; // the first fault is the one to report
    r->failed = true;
    int used = snprintf(r->error, SCENE_ERROR_SIZE, "%s: %s%s%s: ", r->file, r->path,
                        key && key[0] != '[' ? "." : "", key ? key : "");
    if (used < 0 || used >= SCENE_ERROR_SIZE)
        return;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(r->error + used, (size_t)(SCENE_ERROR_SIZE - used), format, arguments);
    va_end(arguments);
    keep_one_line(r->error);
}

// Paths grow and shrink as the reader walks down and up; enter returns the length to go back to.
static size_t enter(struct reader *r, const char *key) {
    size_t length = strlen(r->path);
    snprintf(r->path + length, sizeof r->path - length, "%s%.80s", key[0] == '[' ? "" : ".", key);
    return length;
}

static void leave(struct reader *r, size_t length) {
    r->path[length] = '\0';
}

static const char *kind(const json_t *value) {
    switch (json_typeof(value)) {
    case JSON_OBJECT: return "an object";
    case JSON_ARRAY: return "an array";
    case JSON_STRING: return "a string";
    case JSON_INTEGER:
    case JSON_REAL: return "a number";
    case JSON_TRUE:
    case JSON_FALSE: return "a boolean";
    default: return "null";
    }
}

static void only_keys(struct reader *r, json_t *object, const char *const *known) {
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value) {
        bool found = false;
        for (const char *const *k = known; *k; k++)
            found = found || strcmp(*k, key) == 0;
        if (!found) {
            char list[512] = "";
            for (const char *const *k = known; *k; k++) {
                size_t used = strlen(list);
                snprintf(list + used, sizeof list - used, "%s%s", used ? ", " : "", *k);
            }
            char quoted[96];
            snprintf(quoted, sizeof quoted, "%.80s", key);
            fail(r, quoted, "unknown key; known here: %s", list);
            return;
        }
    }
}

static json_t *member(struct reader *r, json_t *object, const char *key, json_type type,
                      const char *wanted) {
    json_t *value = json_object_get(object, key);
    if (!value)
        fail(r, key, "missing; %s is required", wanted);
    else if (json_typeof(value) != type) {
        fail(r, key, "%s where %s is required", kind(value), wanted);
        value = NULL;
    }
    return value;
}

enum range { ANY, POSITIVE, NOT_NEGATIVE, CELL, ROUNDING, UNIT, FIELD_OF_VIEW };

static double checked(struct reader *r, const char *key, json_t *value, enum range range) {
    if (!json_is_number(value)) {
        fail(r, key, "%s where a number is required", kind(value));
        return 1;
    }
    double x = json_number_value(value);
    if (!isfinite(x))
        fail(r, key, "not a finite number");
    else if (range == POSITIVE && !(x > 0))
        fail(r, key, "%g is not > 0", x);
    else if (range == POSITIVE && x < SMALLEST)
        fail(r, key, "%g is under %g, the smallest length there is", x, SMALLEST);
    else if ((range == NOT_NEGATIVE || range == CELL || range == ROUNDING) && !(x >= 0))
        fail(r, key, "%g is not >= 0", x);
    else if (range == CELL && !(x == 0 || x >= SMALLEST))
        fail(r, key, "%g is neither 0 nor a cell of at least %g", x, SMALLEST);
    else if (range == ROUNDING && !(x == 0 || x >= SMALLEST))
        fail(r, key, "%g is neither 0 nor a radius of at least %g", x, SMALLEST);
    else if (range == UNIT && !(x >= 0 && x <= 1))
        fail(r, key, "%g is not in 0 to 1", x);
    else if (range == FIELD_OF_VIEW && !(x >= 1 && x <= 170))
        fail(r, key, "%g is not in 1 to 170 degrees", x);
    else if (!(fabs(x) <= LARGEST))
        fail(r, key, "%g is beyond %g, the largest number there is", x, LARGEST);
    return x;
}

static double number(struct reader *r, json_t *object, const char *key, enum range range) {
    json_t *value = json_object_get(object, key);
    if (!value) {
        fail(r, key, "missing; a number is required");
        return 1;
    }
    return checked(r, key, value, range);
}

static int whole(struct reader *r, json_t *object, const char *key, int lowest, int highest) {
    json_t *value = json_object_get(object, key);
    if (!value) {
        fail(r, key, "missing; a whole number is required");
        return lowest;
    }
    if (!json_is_number(value)) {
        fail(r, key, "%s where a whole number is required", kind(value));
        return lowest;
    }
    double x = json_number_value(value);
    if (!(x == floor(x)))
        fail(r, key, "%g is not a whole number", x);
    else if (!(x >= lowest))
        fail(r, key, "%g is not >= %d", x, lowest);
    else if (!(x <= highest))
        fail(r, key, "%g is beyond %d, the largest there is", x, highest);
    else
        return (int)x;
    return lowest;
}

static bool vector(struct reader *r, json_t *object, const char *key, enum range range,
                   double out[3]) {
    json_t *value = json_object_get(object, key);
    if (!value) {
        fail(r, key, "missing; three numbers are required");
        return false;
    }
    if (!json_is_array(value) || json_array_size(value) != 3) {
        if (json_is_array(value))
            fail(r, key, "%zu numbers where exactly 3 are required", json_array_size(value));
        else
            fail(r, key, "%s where an array of 3 numbers is required", kind(value));
        return false;
    }
    size_t back = enter(r, key);
    for (int i = 0; i < 3; i++) {
        char index[8];
        snprintf(index, sizeof index, "[%d]", i);
        out[i] = checked(r, index, json_array_get(value, (size_t)i), range);
    }
    leave(r, back);
    return !r->failed;
}

static double dot3(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static bool normalize3(double a[3]) {
    double length = sqrt(dot3(a, a));
    if (length < 1e-140) { // its square has lost digits, or all of them: larger first
        for (int i = 0; i < 3; i++)
            a[i] *= 0x1p600;
        length = sqrt(dot3(a, a));
    }
    if (!(length > 0))
        return false;
    for (int i = 0; i < 3; i++)
        a[i] /= length;
    return true;
}

static void cross3(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static void read_camera(struct reader *r, json_t *root, struct view *view) {
    json_t *camera = member(r, root, "camera", JSON_OBJECT, "an object");
    if (!camera)
        return;
    size_t back = enter(r, "camera");
    static const char *const keys[] = {"position", "look_at", "up", "vertical_fov_degrees", NULL};
    only_keys(r, camera, keys);
    double look_at[3] = {0}, up[3] = {0};
    vector(r, camera, "position", ANY, view->position);
    vector(r, camera, "look_at", ANY, look_at);
    vector(r, camera, "up", ANY, up);
    double fov = number(r, camera, "vertical_fov_degrees", FIELD_OF_VIEW);
    if (!r->failed) {
        for (int i = 0; i < 3; i++)
            view->forward[i] = look_at[i] - view->position[i];
        bool seen = normalize3(view->forward);
        bool upward = normalize3(up);
        cross3(up, view->forward, view->right);
        if (!seen)
            fail(r, "look_at", "is the camera's position; it must differ from it");
        // 1e-6: the sine of the angle below which the frame would be rounding noise.
        else if (!upward || !(sqrt(dot3(view->right, view->right)) > 1e-6))
            fail(r, "up", "is zero or parallel to the direction of view");
        else {
            normalize3(view->right);
            cross3(view->forward, view->right, view->up);
            view->tan_half_fov = tan(fov * (M_PI / 180.0) / 2.0);
        }
    }
    leave(r, back);
}

static void read_light(struct reader *r, json_t *root, struct scene *scene) {
    json_t *light = member(r, root, "light", JSON_OBJECT, "an object");
    if (!light)
        return;
    size_t back = enter(r, "light");
    static const char *const keys[] = {"position", "emission", "shadows", "shadow_strength", NULL};
    only_keys(r, light, keys);
    vector(r, light, "position", ANY, scene->view.light_position);
    vector(r, light, "emission", NOT_NEGATIVE, scene->view.light_emission);
    json_t *shadows = member(r, light, "shadows", JSON_STRING, "\"soft\", \"hard\" or \"none\"");
    if (shadows) {
        const char *text = json_string_value(shadows);
        int found = -1;
        for (int i = 0; i < 3; i++)
            if (strcmp(text, SHADOW_NAMES[i]) == 0)
                found = i;
        if (found < 0)
            fail(r, "shadows", "\"%.80s\" is not one of \"soft\", \"hard\", \"none\"", text);
        else
            scene->model.shadows = (enum shadows)found;
    }
    scene->model.shadow_strength = number(r, light, "shadow_strength", POSITIVE);
    leave(r, back);
}

static void read_march(struct reader *r, json_t *root, struct limits *march) {
    json_t *object = member(r, root, "march", JSON_OBJECT, "an object");
    if (!object)
        return;
    size_t back = enter(r, "march");
    static const char *const keys[] = {"max_steps",   "hit_distance", "bounds_radius",
                                       "max_bounces", "normal_step",  "surface_offset",
                                       NULL};
    only_keys(r, object, keys);
    march->max_steps = whole(r, object, "max_steps", 1, MOST);
    march->hit_distance = number(r, object, "hit_distance", POSITIVE);
    march->bounds_radius = number(r, object, "bounds_radius", POSITIVE);
    march->max_bounces = whole(r, object, "max_bounces", 0, MOST_BOUNCES);
    march->normal_step = number(r, object, "normal_step", POSITIVE);
    march->surface_offset = number(r, object, "surface_offset", POSITIVE);
    leave(r, back);
}

static void *allocate(struct reader *r, size_t count, size_t size) {
    void *memory = calloc(count ? count : 1, size);
    if (!memory)
        fail(r, NULL, "out of memory");
    return memory;
}

static void read_materials(struct reader *r, json_t *root, struct model *model) {
    json_t *materials = member(r, root, "materials", JSON_OBJECT, "an object");
    if (!materials)
        return;
    model->materials = allocate(r, json_object_size(materials), sizeof *model->materials);
    size_t back = enter(r, "materials");
    const char *name;
    json_t *object;
    json_object_foreach(materials, name, object) {
        if (r->failed)
            break;
        if (!json_is_object(object)) {
            char quoted[96];
            snprintf(quoted, sizeof quoted, "%.80s", name);
            fail(r, quoted, "%s where an object is required", kind(object));
            break;
        }
        size_t inner = enter(r, name);
        static const char *const keys[] = {"color", "reflectivity", "shininess", NULL};
        only_keys(r, object, keys);
        struct material *material = &model->materials[model->material_count++];
        vector(r, object, "color", NOT_NEGATIVE, material->color);
        material->reflectivity = number(r, object, "reflectivity", UNIT);
        material->shininess = number(r, object, "shininess", POSITIVE);
        leave(r, inner);
    }
    leave(r, back);
}

static int material_index(json_t *materials, const char *wanted) {
    int index = 0;
    const char *name;
    json_t *object;
    json_object_foreach(materials, name, object) {
        if (strcmp(name, wanted) == 0)
            return index;
        index++;
    }
    return -1;
}

static void read_plane(struct reader *r, json_t *object, struct shape *shape) {
    double *n = shape->plane.normal;
    if (!vector(r, object, "normal", ANY, n))
        return;
    double length = sqrt(dot3(n, n));
    shape->plane.offset = number(r, object, "offset", ANY);
    if (!(length >= SMALLEST)) {
        fail(r, "normal", "is zero; a direction is required");
        return;
    }
    normalize3(n); // n·p = offset keeps its plane when both are divided
    shape->plane.offset /= length;
    if (!(fabs(shape->plane.offset) <= LARGEST))
        fail(r, "offset", "divided by the length of normal it is beyond %g", LARGEST);
}

static void read_sizes(struct reader *r, json_t *object, struct shape *shape) {
    static const char *const keys[SHAPE_TYPES][4] = {
        {"radius"},
        {"half_size", "rounding"},
        {"major_radius", "minor_radius"},
        {"bottom_radius", "top_radius", "half_height"},
        {"radius"},
        {"normal", "offset"},
        {"power", "iterations", "bailout"},
    };
    const char *known[11] = {"type", "material", "position", "rotation_degrees", "repeat", "path"};
    for (int i = 0; i < 4 && keys[shape->type][i]; i++)
        known[6 + i] = keys[shape->type][i];
    only_keys(r, object, known);
    switch (shape->type) {
    case SHAPE_SPHERE: shape->sphere.radius = number(r, object, "radius", POSITIVE); break;
    case SHAPE_BOX:
        vector(r, object, "half_size", POSITIVE, shape->box.half_size);
        if (json_object_get(object, "rounding"))
            shape->box.rounding = number(r, object, "rounding", ROUNDING);
        if (shape->box.rounding > 0)
            shape->type = SHAPE_ROUNDED_BOX;
        break;
    case SHAPE_TORUS:
        shape->torus.major_radius = number(r, object, "major_radius", POSITIVE);
        shape->torus.minor_radius = number(r, object, "minor_radius", POSITIVE);
        break;
    case SHAPE_CONE:
        shape->cone.bottom_radius = number(r, object, "bottom_radius", POSITIVE);
        shape->cone.top_radius = number(r, object, "top_radius", POSITIVE);
        shape->cone.half_height = number(r, object, "half_height", POSITIVE);
        break;
    case SHAPE_OCTAHEDRON: shape->octahedron.radius = number(r, object, "radius", POSITIVE); break;
    case SHAPE_PLANE: read_plane(r, object, shape); break;
    case SHAPE_MANDELBULB:
        shape->mandelbulb.power = number(r, object, "power", POSITIVE);
        if (!r->failed && shape->mandelbulb.power != 8)
            fail(r, "power", "%g is not 8, the only power there is a map for",
                 shape->mandelbulb.power);
        shape->mandelbulb.iterations = whole(r, object, "iterations", 1, MOST_ITERATIONS);
        shape->mandelbulb.bailout = number(r, object, "bailout", POSITIVE);
        // |w|² may grow to bailout^8 in the last iteration, and must stay a float.
        if (!r->failed && !(shape->mandelbulb.bailout >= 4 && shape->mandelbulb.bailout <= 1e4))
            fail(r, "bailout", "%g is not in 4 to 10000", shape->mandelbulb.bailout);
        break;
    default: break;
    }
}

// A circle's foot on its axis; false: the shape is on the axis, or so near that it would move by rounding alone.
static bool find_foot(struct path *path, const double position[3], const double centre[3]) {
    double from[3], along, radius_sq = 0, size_sq = dot3(position, position);
    for (int i = 0; i < 3; i++)
        from[i] = position[i] - centre[i];
    along = dot3(from, path->axis);
    for (int i = 0; i < 3; i++) {
        path->foot[i] = centre[i] + along * path->axis[i];
        radius_sq += (position[i] - path->foot[i]) * (position[i] - path->foot[i]);
    }
    return radius_sq >= SMALLEST * SMALLEST && radius_sq > 1e-24 * (size_sq + dot3(centre, centre));
}

static void read_circle(struct reader *r, json_t *object, struct shape *shape) {
    static const char *const keys[] = {"type", "period", "centre", "axis", NULL};
    struct path *path = &shape->path;
    double centre[3] = {0};
    only_keys(r, object, keys);
    vector(r, object, "centre", ANY, centre);
    if (!vector(r, object, "axis", ANY, path->axis))
        return;
    if (!(sqrt(dot3(path->axis, path->axis)) >= SMALLEST)) {
        fail(r, "axis", "is zero; a direction is required");
        return;
    }
    normalize3(path->axis);
    if (!find_foot(path, shape->position, centre)) {
        fail(r, "centre", "the shape's position is on the circle's axis; it would not move");
        return;
    }
    double reach = 0;
    for (int i = 0; i < 3; i++)
        reach += (shape->position[i] - path->foot[i]) * (shape->position[i] - path->foot[i]);
    for (int i = 0; i < 3; i++)
        if (!(fabs(path->foot[i]) + sqrt(reach) <= LARGEST))
            fail(r, "centre", "the circle leads beyond %g, the largest number there is", LARGEST);
}

static void read_line(struct reader *r, json_t *object, struct shape *shape) {
    static const char *const keys[] = {"type", "period", "to", NULL};
    only_keys(r, object, keys);
    double *to = shape->path.to;
    const double *p = shape->position;
    if (vector(r, object, "to", ANY, to) && to[0] == p[0] && to[1] == p[1] && to[2] == p[2])
        fail(r, "to", "is the shape's position; it must differ from it");
}

static void read_path(struct reader *r, json_t *shape_object, struct shape *shape) {
    json_t *object = member(r, shape_object, "path", JSON_OBJECT, "an object");
    if (!object)
        return;
    size_t back = enter(r, "path");
    json_t *type = member(r, object, "type", JSON_STRING, "\"circle\" or \"line\"");
    if (type) {
        const char *text = json_string_value(type);
        shape->path.period = number(r, object, "period", POSITIVE);
        if (strcmp(text, "circle") == 0) {
            shape->path.type = PATH_CIRCLE;
            read_circle(r, object, shape);
        } else if (strcmp(text, "line") == 0) {
            shape->path.type = PATH_LINE;
            read_line(r, object, shape);
        } else
            fail(r, "type", "\"%.80s\" is not one of \"circle\", \"line\"", text);
    }
    leave(r, back);
}

static void read_shape(struct reader *r, json_t *object, json_t *materials, struct shape *shape) {
    json_t *type = member(r, object, "type", JSON_STRING, "the name of a shape");
    if (!type)
        return;
    int found = -1;
    for (int i = 0; i < SHAPE_ROUNDED_BOX; i++) // which is a box in the file
        if (strcmp(json_string_value(type), TYPE_NAMES[i]) == 0)
            found = i;
    if (found < 0) {
        fail(r, "type",
             "\"%.80s\" is not a shape; there are sphere, box, torus, cone, octahedron, plane, "
             "mandelbulb",
             json_string_value(type));
        return;
    }
    shape->type = (enum shape_type)found;
    read_sizes(r, object, shape);
    if (json_object_get(object, "position"))
        vector(r, object, "position", ANY, shape->position);
    if (json_object_get(object, "rotation_degrees"))
        vector(r, object, "rotation_degrees", ANY, shape->rotation_degrees);
    if (json_object_get(object, "repeat"))
        vector(r, object, "repeat", CELL, shape->repeat);
    if (json_object_get(object, "path") && !r->failed)
        read_path(r, object, shape);
    json_t *material = member(r, object, "material", JSON_STRING, "the name of a material");
    if (material && !r->failed) {
        shape->material = material_index(materials, json_string_value(material));
        if (shape->material < 0)
            fail(r, "material", "\"%.80s\" is not defined in $.materials",
                 json_string_value(material));
    }
}

static void read_shapes(struct reader *r, json_t *root, struct model *model) {
    json_t *shapes = member(r, root, "shapes", JSON_ARRAY, "an array of shapes");
    if (!shapes)
        return;
    size_t count = json_array_size(shapes);
    if (count < 1 || count > SCENE_MAX_SHAPES) {
        fail(r, "shapes", "%zu shapes; 1 to %d are allowed", count, SCENE_MAX_SHAPES);
        return;
    }
    model->shapes = allocate(r, count, sizeof *model->shapes);
    json_t *materials = json_object_get(root, "materials");
    size_t back = enter(r, "shapes");
    for (size_t i = 0; i < count && !r->failed; i++) {
        char index[24];
        snprintf(index, sizeof index, "[%zu]", i);
        json_t *object = json_array_get(shapes, i);
        if (!json_is_object(object)) {
            fail(r, index, "%s where an object is required", kind(object));
            break;
        }
        size_t inner = enter(r, index);
        read_shape(r, object, materials, &model->shapes[i]);
        leave(r, inner);
        model->shape_count++;
    }
    leave(r, back);
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
}

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

static bool hash_scene(json_t *root, const struct limits *march, char hash[17]) {
    char used[64];
    uint64_t h = 0xcbf29ce484222325u;
    if (!hash_json(&h, root))
        return false;
    snprintf(used, sizeof used, "%a %d", march->hit_distance, march->max_steps);
    snprintf(hash, 17, "%016llx", (unsigned long long)hash_text(h, used));
    return true;
}

static void name_scene(const char *path, char name[64]) {
    const char *slash = strrchr(path, '/');
    snprintf(name, 64, "%s", slash ? slash + 1 : path);
    char *dot = strrchr(name, '.');
    if (dot && dot != name)
        *dot = '\0';
    for (char *c = name; *c; c++) // it goes into JSON, which is UTF-8, and was cut somewhere
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
        keep_one_line(error);
        return false;
    }
    struct model *model = &scene->model;
    if (!json_is_object(root))
        fail(r, NULL, "%s where an object is required", kind(root));
    else {
        static const char *const keys[] = {"camera", "light",     "background", "fog",
                                           "march",  "materials", "shapes",     NULL};
        only_keys(r, root, keys);
        read_camera(r, root, &scene->view);
        read_light(r, root, scene);
        vector(r, root, "background", NOT_NEGATIVE, model->background);
        model->fog = number(r, root, "fog", NOT_NEGATIVE);
        read_march(r, root, &model->march);
        read_materials(r, root, model);
        read_shapes(r, root, model);
    }
    if (!r->failed) {
        if (overrides && overrides->hit_distance > 0)
            model->march.hit_distance = overrides->hit_distance;
        if (overrides && overrides->max_steps > 0)
            model->march.max_steps = overrides->max_steps;
        find_features(model);
        name_scene(path, scene->name);
        if (!hash_scene(root, &model->march, scene->hash))
            fail(r, NULL, "out of memory");
    }
    json_decref(root);
    if (r->failed)
        scene_free(scene);
    return !r->failed;
}

// Cosine and sine of whole turns: quarters are exact, so that a period's quarters are where arithmetic by hand
// has them.
static void circle(double turns, double *c, double *s) {
    double quarters = rint(4.0 * turns), rest = 2.0 * M_PI * (turns - quarters / 4.0);
    double x = cos(rest), y = sin(rest);
    switch (((int)quarters % 4 + 4) % 4) {
    case 0: *c = x, *s = y; break;
    case 1: *c = -y, *s = x; break;
    case 2: *c = -x, *s = -y; break;
    default: *c = y, *s = -x; break;
    }
}

static void move_shape(const struct shape *still, double seconds, double position[3]) {
    const struct path *path = &still->path;
    double c, s, from_axis[3], ahead[3];
    circle(fmod(seconds, path->period) / path->period, &c, &s);
    for (int i = 0; i < 3; i++)
        from_axis[i] = still->position[i] - path->foot[i];
    cross3(path->axis, from_axis, ahead);
    for (int i = 0; i < 3; i++) // of the way from the position: none at time 0
        position[i] =
            still->position[i] + (path->type == PATH_CIRCLE
                                      ? (c - 1.0) * from_axis[i] + s * ahead[i]
                                      : (1.0 - c) / 2.0 * (path->to[i] - still->position[i]));
}

void model_move(const struct model *model, double seconds, struct model *moved) {
    for (int i = 0; i < model->shape_count; i++) {
        moved->shapes[i] = model->shapes[i];
        if (model->shapes[i].path.type != PATH_NONE)
            move_shape(&model->shapes[i], seconds, moved->shapes[i].position);
    }
}

void scene_free(struct scene *scene) {
    free(scene->model.shapes);
    free(scene->model.materials);
    memset(scene, 0, sizeof *scene);
}
