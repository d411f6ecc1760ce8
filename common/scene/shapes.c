// Reads one shape of a scene: its type, sizes, transform and material.
#include <math.h>
#include <string.h>

#include "scene/internal.h"
#include "scene/vector.h"

enum { MAX_ITERATIONS = 1000, MAX_BOX_ITERATIONS = 100, TYPES = SHAPE_GYROID + 1 };

static const char *const TYPE_NAMES[TYPES] = {
    "sphere",    "box",         "torus", "cone",    "octahedron", "plane", "mandelbulb",
    "mandelbox", "rounded box", "group", "capsule", "ellipsoid",  "gyroid"};

const char *shape_type_name(enum shape_type type) {
    return TYPE_NAMES[type];
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
    if (!reader_vector(r, object, "normal", ANY, n))
        return;
    double length = sqrt(dot3(n, n));
    shape->plane.offset = reader_number(r, object, "offset", ANY);
    if (!(length >= SMALLEST)) {
        reader_fail(r, "normal", "is zero; a direction is required");
        return;
    }
    normalize3(n); // dividing both sides of n·p = offset keeps the plane
    shape->plane.offset /= length;
    if (!(fabs(shape->plane.offset) <= LARGEST))
        reader_fail(r, "offset", "divided by the length of normal it is beyond %g", LARGEST);
}

// Reads a Mandelbox. After n iterations its point has moved by |scale|^n at most, for |scale| > 1, and its
// derivative is (|scale|·(fixed/minimum)²)^n at most. Both must stay finite in float, the first squared.
static void read_mandelbox(struct reader *r, json_t *object, struct shape *shape) {
    double scale = shape->mandelbox.scale = reader_number(r, object, "scale", ANY);
    shape->mandelbox.fold_limit = reader_number(r, object, "fold_limit", POSITIVE);
    double minimum = shape->mandelbox.minimum_radius =
        reader_number(r, object, "minimum_radius", POSITIVE);
    double fixed = shape->mandelbox.fixed_radius =
        reader_number(r, object, "fixed_radius", POSITIVE);
    int n = shape->mandelbox.iterations =
        reader_whole(r, object, "iterations", 1, MAX_BOX_ITERATIONS);
    if (r->failed)
        return;
    double ratio = fixed / minimum, stretch = fmax(fabs(scale), 1);
    if (!(fabs(scale) >= SMALLEST))
        reader_fail(r, "scale", "%g should be %g or more, or -%g or less", scale, SMALLEST,
                    SMALLEST);
    else if (!(ratio >= 1 && ratio <= 100))
        reader_fail(r, "minimum_radius", "%g is not between fixed_radius/100 and fixed_radius, %g",
                    minimum, fixed);
    else if (!(pow(stretch, n) <= 1e6))
        reader_fail(r, "iterations",
                    "|scale|^iterations is %g, beyond 1e6: at most %d for this scale",
                    pow(stretch, n), (int)(log(1e6) / log(stretch)));
    else if (!(pow(stretch * ratio * ratio, n) <= 1e30))
        reader_fail(
            r, "iterations",
            "(|scale|*(fixed_radius/minimum_radius)^2)^iterations is %g, beyond 1e30: at most "
            "%d for these numbers",
            pow(stretch * ratio * ratio, n), (int)(log(1e30) / log(stretch * ratio * ratio)));
}

// Sizes of the file's types. A rounded box is a box there. A plane's `offset` is its own, not the modifier.
static const char *const FILE_KEYS[TYPES][6] = {
    [SHAPE_SPHERE] = {"radius"},
    [SHAPE_BOX] = {"half_size", "rounding"},
    [SHAPE_TORUS] = {"major_radius", "minor_radius"},
    [SHAPE_CONE] = {"bottom_radius", "top_radius", "half_height"},
    [SHAPE_OCTAHEDRON] = {"radius"},
    [SHAPE_PLANE] = {"normal"},
    [SHAPE_MANDELBULB] = {"power", "iterations", "bailout"},
    [SHAPE_MANDELBOX] = {"scale", "fold_limit", "minimum_radius", "fixed_radius", "iterations"},
    [SHAPE_GROUP] = {"operation", "blend", "shapes"},
    [SHAPE_CAPSULE] = {"radius", "half_height"},
    [SHAPE_ELLIPSOID] = {"radius"},
    [SHAPE_GYROID] = {"cell", "thickness"},
};

static void check_keys(struct reader *r, json_t *object, enum shape_type type) {
    static const char *const every[] = {"type", "position", "rotation_degrees", "repeat", "path"};
    static const char *const modifiers[] = {"offset", "shell", "mirror", "displace", "twist"};
    const char *known[20] = {0};
    int count = 0;
    for (int i = 0; i < 5; i++)
        known[count++] = every[i];
    if (type != SHAPE_GROUP)
        known[count++] = "material";
    for (const char *const *key = FILE_KEYS[type]; *key; key++)
        known[count++] = *key;
    for (int i = 0; i < 5 && !is_fractal(type); i++)
        known[count++] = modifiers[i];
    reader_only_keys(r, object, known);
}

static void read_ellipsoid(struct reader *r, json_t *object, struct shape *shape) {
    double *a = shape->ellipsoid.radius;
    if (reader_vector(r, object, "radius", POSITIVE, a) &&
        !(fmax(a[0], fmax(a[1], a[2])) <= 1000 * fmin(a[0], fmin(a[1], a[2]))))
        reader_fail(r, "radius", "the largest is more than 1000 times the least");
}

static void read_sizes(struct reader *r, json_t *object, struct shape *shape) {
    check_keys(r, object, shape->type);
    switch ((int)shape->type) {
    case SHAPE_BOX:
        reader_vector(r, object, "half_size", POSITIVE, shape->box.half_size);
        if (json_object_get(object, "rounding"))
            shape->box.rounding = reader_number(r, object, "rounding", ROUNDING);
        if (shape->box.rounding > 0)
            shape->type = SHAPE_ROUNDED_BOX;
        break;
    case SHAPE_PLANE: read_plane(r, object, shape); break;
    case SHAPE_MANDELBULB:
        shape->mandelbulb.power = reader_number(r, object, "power", POSITIVE);
        if (!r->failed && shape->mandelbulb.power != 8)
            reader_fail(r, "power", "%g is not 8, the only power there is a map for",
                        shape->mandelbulb.power);
        shape->mandelbulb.iterations = reader_whole(r, object, "iterations", 1, MAX_ITERATIONS);
        shape->mandelbulb.bailout = reader_number(r, object, "bailout", POSITIVE);
        // |w|² can grow to bailout^8 in the last iteration, which must stay below FLT_MAX.
        if (!r->failed && !(shape->mandelbulb.bailout >= 4 && shape->mandelbulb.bailout <= 1e4))
            reader_fail(r, "bailout", "%g is not in 4 to 10000", shape->mandelbulb.bailout);
        break;
    case SHAPE_MANDELBOX: read_mandelbox(r, object, shape); break;
    case SHAPE_ELLIPSOID: read_ellipsoid(r, object, shape); break;
    case SHAPE_GROUP: break;
    default: // positive numbers, in the order of struct shape
        for (int i = 0; FILE_KEYS[shape->type][i]; i++)
            shape->sizes[i] = reader_number(r, object, FILE_KEYS[shape->type][i], POSITIVE);
    }
}

void scene_read_shape(struct reader *r, json_t *object, json_t *materials, struct shape *shape) {
    json_t *type = reader_member(r, object, "type", JSON_STRING, "the name of a shape");
    if (!type)
        return;
    int found = -1;
    for (int i = 0; i < TYPES; i++)
        if (FILE_KEYS[i][0] && strcmp(json_string_value(type), TYPE_NAMES[i]) == 0)
            found = i;
    if (found < 0) {
        reader_fail(
            r, "type",
            "\"%.80s\" is not a shape; there are sphere, box, torus, cone, octahedron, plane, "
            "mandelbulb, mandelbox, capsule, ellipsoid, gyroid, group",
            json_string_value(type));
        return;
    }
    shape->type = (enum shape_type)found;
    read_sizes(r, object, shape);
    if (json_object_get(object, "position"))
        reader_vector(r, object, "position", ANY, shape->position);
    if (json_object_get(object, "rotation_degrees"))
        reader_vector(r, object, "rotation_degrees", ANY, shape->rotation_degrees);
    if (json_object_get(object, "repeat"))
        reader_vector(r, object, "repeat", CELL, shape->repeat);
    if (json_object_get(object, "path") && !r->failed)
        scene_read_path(r, object, shape->position, &shape->path);
    if (shape->type == SHAPE_GROUP)
        return;
    json_t *material = reader_member(r, object, "material", JSON_STRING, "the name of a material");
    if (material && !r->failed) {
        shape->material = material_index(materials, json_string_value(material));
        if (shape->material < 0)
            reader_fail(r, "material", "\"%.80s\" is not defined in $.materials",
                        json_string_value(material));
    }
}
