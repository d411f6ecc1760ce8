// Reads a scene's shapes.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "scene/internal.h"
#include "scene/vector.h"

enum { MAX_ITERATIONS = 1000, MAX_BOX_ITERATIONS = 100 };

static const char *const TYPE_NAMES[] = {
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

static void read_sizes(struct reader *r, json_t *object, struct shape *shape) {
    static const char *const keys[SHAPE_TYPES][5] = {
        {"radius"},
        {"half_size", "rounding"},
        {"major_radius", "minor_radius"},
        {"bottom_radius", "top_radius", "half_height"},
        {"radius"},
        {"normal", "offset"},
        {"power", "iterations", "bailout"},
        {"scale", "fold_limit", "minimum_radius", "fixed_radius", "iterations"},
    };
    const char *known[12] = {"type", "material", "position", "rotation_degrees", "repeat", "path"};
    for (int i = 0; i < 5 && keys[shape->type][i]; i++)
        known[6 + i] = keys[shape->type][i];
    reader_only_keys(r, object, known);
    switch (shape->type) {
    case SHAPE_SPHERE: shape->sphere.radius = reader_number(r, object, "radius", POSITIVE); break;
    case SHAPE_BOX:
        reader_vector(r, object, "half_size", POSITIVE, shape->box.half_size);
        if (json_object_get(object, "rounding"))
            shape->box.rounding = reader_number(r, object, "rounding", ROUNDING);
        if (shape->box.rounding > 0)
            shape->type = SHAPE_ROUNDED_BOX;
        break;
    case SHAPE_TORUS:
        shape->torus.major_radius = reader_number(r, object, "major_radius", POSITIVE);
        shape->torus.minor_radius = reader_number(r, object, "minor_radius", POSITIVE);
        break;
    case SHAPE_CONE:
        shape->cone.bottom_radius = reader_number(r, object, "bottom_radius", POSITIVE);
        shape->cone.top_radius = reader_number(r, object, "top_radius", POSITIVE);
        shape->cone.half_height = reader_number(r, object, "half_height", POSITIVE);
        break;
    case SHAPE_OCTAHEDRON:
        shape->octahedron.radius = reader_number(r, object, "radius", POSITIVE);
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
    default: break;
    }
}

static void read_shape(struct reader *r, json_t *object, json_t *materials, struct shape *shape) {
    json_t *type = reader_member(r, object, "type", JSON_STRING, "the name of a shape");
    if (!type)
        return;
    int found = -1;
    for (int i = 0; i < SHAPE_ROUNDED_BOX; i++) // a rounded box is a box in the file
        if (strcmp(json_string_value(type), TYPE_NAMES[i]) == 0)
            found = i;
    if (found < 0) {
        reader_fail(
            r, "type",
            "\"%.80s\" is not a shape; there are sphere, box, torus, cone, octahedron, plane, "
            "mandelbulb, mandelbox",
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
    json_t *material = reader_member(r, object, "material", JSON_STRING, "the name of a material");
    if (material && !r->failed) {
        shape->material = material_index(materials, json_string_value(material));
        if (shape->material < 0)
            reader_fail(r, "material", "\"%.80s\" is not defined in $.materials",
                        json_string_value(material));
    }
}

void scene_read_shapes(struct reader *r, json_t *root, struct model *model) {
    json_t *shapes = reader_member(r, root, "shapes", JSON_ARRAY, "an array of shapes");
    if (!shapes)
        return;
    size_t count = json_array_size(shapes);
    if (count < 1 || count > SCENE_MAX_SHAPES) {
        reader_fail(r, "shapes", "%zu shapes; 1 to %d are allowed", count, SCENE_MAX_SHAPES);
        return;
    }
    model->shapes = reader_allocate(r, count, sizeof *model->shapes);
    json_t *materials = json_object_get(root, "materials");
    size_t back = reader_enter(r, "shapes");
    for (size_t i = 0; i < count && !r->failed; i++) {
        char index[24];
        snprintf(index, sizeof index, "[%zu]", i);
        json_t *object = json_array_get(shapes, i);
        if (!json_is_object(object)) {
            reader_fail(r, index, "%s where an object is required", reader_kind(object));
            break;
        }
        size_t inner = reader_enter(r, index);
        read_shape(r, object, materials, &model->shapes[i]);
        reader_leave(r, inner);
        model->shape_count++;
    }
    reader_leave(r, back);
}
