// Paths of shapes: what a scene says of them, and where they lead.
#include <math.h>
#include <string.h>

#include "scene/parts.h"
#include "scene/vector.h"

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
    reader_only_keys(r, object, keys);
    reader_vector(r, object, "centre", ANY, centre);
    if (!reader_vector(r, object, "axis", ANY, path->axis))
        return;
    if (!(sqrt(dot3(path->axis, path->axis)) >= SMALLEST)) {
        reader_fail(r, "axis", "is zero; a direction is required");
        return;
    }
    normalize3(path->axis);
    if (!find_foot(path, shape->position, centre)) {
        reader_fail(r, "centre", "the shape's position is on the circle's axis; it would not move");
        return;
    }
    double reach = 0;
    for (int i = 0; i < 3; i++)
        reach += (shape->position[i] - path->foot[i]) * (shape->position[i] - path->foot[i]);
    for (int i = 0; i < 3; i++)
        if (!(fabs(path->foot[i]) + sqrt(reach) <= LARGEST))
            reader_fail(r, "centre", "the circle leads beyond %g, the largest number there is",
                        LARGEST);
}

static void read_line(struct reader *r, json_t *object, struct shape *shape) {
    static const char *const keys[] = {"type", "period", "to", NULL};
    reader_only_keys(r, object, keys);
    double *to = shape->path.to;
    const double *p = shape->position;
    if (reader_vector(r, object, "to", ANY, to) && to[0] == p[0] && to[1] == p[1] && to[2] == p[2])
        reader_fail(r, "to", "is the shape's position; it must differ from it");
}

void scene_read_path(struct reader *r, json_t *shape_object, struct shape *shape) {
    json_t *object = reader_member(r, shape_object, "path", JSON_OBJECT, "an object");
    if (!object)
        return;
    size_t back = reader_enter(r, "path");
    json_t *type = reader_member(r, object, "type", JSON_STRING, "\"circle\" or \"line\"");
    if (type) {
        const char *text = json_string_value(type);
        shape->path.period = reader_number(r, object, "period", POSITIVE);
        if (strcmp(text, "circle") == 0) {
            shape->path.type = PATH_CIRCLE;
            read_circle(r, object, shape);
        } else if (strcmp(text, "line") == 0) {
            shape->path.type = PATH_LINE;
            read_line(r, object, shape);
        } else
            reader_fail(r, "type", "\"%.80s\" is not one of \"circle\", \"line\"", text);
    }
    reader_leave(r, back);
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
