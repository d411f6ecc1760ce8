// Paths of shapes and of the camera: reads them, and computes positions along them.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "scene/internal.h"
#include "scene/vector.h"

// Computes the circle's centre, the point of its axis nearest to the position. Returns false if the
// position is on the axis, or so close that only rounding errors would move it.
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

static void read_circle(struct reader *r, json_t *object, const double position[3],
                        struct path *path) {
    static const char *const keys[] = {"type", "period", "centre", "axis", NULL};
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
    if (!find_foot(path, position, centre)) {
        reader_fail(r, "centre", "the position is on the circle's axis; it would not move");
        return;
    }
    double reach = 0;
    for (int i = 0; i < 3; i++)
        reach += (position[i] - path->foot[i]) * (position[i] - path->foot[i]);
    for (int i = 0; i < 3; i++)
        if (!(fabs(path->foot[i]) + sqrt(reach) <= LARGEST))
            reader_fail(r, "centre", "the circle leads beyond %g, the largest number there is",
                        LARGEST);
}

static void read_line(struct reader *r, json_t *object, const double p[3], struct path *path) {
    static const char *const keys[] = {"type", "period", "to", NULL};
    reader_only_keys(r, object, keys);
    double *to = path->to;
    if (reader_vector(r, object, "to", ANY, to) && to[0] == p[0] && to[1] == p[1] && to[2] == p[2])
        reader_fail(r, "to", "is the position itself; it must differ from it");
}

void scene_read_path(struct reader *r, json_t *owner, const double position[3], struct path *path) {
    json_t *object = reader_member(r, owner, "path", JSON_OBJECT, "an object");
    if (!object)
        return;
    size_t back = reader_enter(r, "path");
    json_t *type = reader_member(r, object, "type", JSON_STRING, "\"circle\" or \"line\"");
    if (type) {
        const char *text = json_string_value(type);
        path->period = reader_number(r, object, "period", POSITIVE);
        if (strcmp(text, "circle") == 0) {
            path->type = PATH_CIRCLE;
            read_circle(r, object, position, path);
        } else if (strcmp(text, "line") == 0) {
            path->type = PATH_LINE;
            read_line(r, object, position, path);
        } else
            reader_fail(r, "type", "\"%.80s\" is not one of \"circle\", \"line\"", text);
    }
    reader_leave(r, back);
}

// Cosine and sine of an angle in turns. They are exact at quarter turns, so that positions at quarters
// of a period are exact too.
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

void path_follow(const struct path *path, const double still[3], double seconds,
                 double position[3]) {
    double c, s, from_axis[3], ahead[3];
    circle(fmod(seconds, path->period) / path->period, &c, &s);
    for (int i = 0; i < 3; i++)
        from_axis[i] = still[i] - path->foot[i];
    cross3(path->axis, from_axis, ahead);
    for (int i = 0; i < 3; i++) // adds the offset from the position, exactly 0 at time 0
        position[i] =
            still[i] + (path->type == PATH_CIRCLE ? (c - 1.0) * from_axis[i] + s * ahead[i]
                                                  : (1.0 - c) / 2.0 * (path->to[i] - still[i]));
}

bool model_copy(const struct model *model, struct model *moved) {
    size_t shapes = (size_t)model->shape_count * sizeof *model->shapes;
    size_t nodes = (size_t)model->node_count * sizeof *model->nodes;
    *moved = *model;
    moved->shapes = malloc(shapes + nodes);
    if (!moved->shapes)
        return false;
    memcpy(moved->shapes, model->shapes, shapes);
    moved->nodes = (struct node *)(moved->shapes + model->shape_count);
    if (nodes)
        memcpy(moved->nodes, model->nodes, nodes);
    for (int i = 0; i < model->shape_count; i++)
        if (model->shapes[i].type == SHAPE_GROUP)
            moved->shapes[i].group.nodes = moved->nodes;
    return true;
}

static void move(const struct shape *still, double seconds, struct shape *moved) {
    *moved = *still;
    if (still->path.type != PATH_NONE)
        path_follow(&still->path, still->position, seconds, moved->position);
}

void model_move(const struct model *model, double seconds, struct model *moved) {
    for (int i = 0; i < model->shape_count; i++) {
        move(&model->shapes[i], seconds, &moved->shapes[i]);
        if (model->shapes[i].type == SHAPE_GROUP)
            moved->shapes[i].group.nodes = moved->nodes;
    }
    for (int i = 0; i < model->node_count; i++)
        move(&model->nodes[i].shape, seconds, &moved->nodes[i].shape);
    if (model->node_count > 0)
        model_bound_nodes(moved);
}
