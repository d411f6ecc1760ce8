// Fuzzes the paths of shapes (common/scene/path.c): the input's bytes are the numbers of a path, so that most
// inputs are paths, and a shape on a path stays where geometry says.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "scene/internal.h"
#include "scene/vector.h"

#define CHECK(condition) ((condition) ? (void)0 : broken(#condition, __LINE__))
enum { NUMBERS = 12 };

static void broken(const char *condition, int line) {
    fprintf(stderr, "path.c:%d: does not hold: %s\n", line, condition);
    abort();
}

static double distance(const double a[3], const double b[3]) {
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static void position_at(struct shape *shape, double seconds, double position[3]) {
    struct shape there = *shape;
    struct model still = {.shape_count = 1, .shapes = shape},
                 moved = {.shape_count = 1, .shapes = &there};
    model_move(&still, seconds, &moved);
    memcpy(position, there.position, sizeof there.position);
}

// A circle keeps its distance to its axis point; a line is half way at a quarter and there at a half of its period.
// other: the circle's centre, or the line's end. Rounding errors are of the size of the largest number.
static void check(struct shape *shape, const double other[3], double seconds) {
    const struct path *path = &shape->path;
    const double *p = shape->position;
    double at[3], size = 1 + fabs(p[0]) + fabs(p[1]) + fabs(p[2]);
    double error = 1e-12 * (size + fabs(other[0]) + fabs(other[1]) + fabs(other[2]));
    position_at(shape, 0, at);
    CHECK(distance(at, p) == 0);
    position_at(shape, path->period, at);
    CHECK(distance(at, p) == 0);
    position_at(shape, path->period / 2, at);
    if (path->type == PATH_LINE)
        CHECK(distance(at, path->to) <= error);
    else
        CHECK(fabs(distance(at, p) - 2 * distance(p, path->foot)) <= error);
    position_at(shape, seconds, at);
    if (path->type == PATH_CIRCLE)
        CHECK(fabs(distance(at, path->foot) - distance(p, path->foot)) <= error);
    else
        CHECK(distance(at, p) + distance(at, path->to) <= distance(p, path->to) + error);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    double n[NUMBERS] = {0};
    if (size < 1 + sizeof n)
        return -1; // libFuzzer: not for the corpus
    memcpy(n, data + 1, sizeof n);
    for (int i = 0; i < NUMBERS; i++)
        if (!isfinite(n[i]))
            return -1; // JSON has no such numbers
    struct shape shape = {.position = {n[0], n[1], n[2]}};
    for (int i = 0; i < 3; i++)
        if (!(fabs(n[i]) <= LARGEST))
            return -1; // refused before a path is read
    json_t *object = data[0] & 1 ? json_pack("{s:{s:s,s:f,s:[f,f,f],s:[f,f,f]}}", "path", "type",
                                             "circle", "period", n[3], "centre", n[4], n[5], n[6],
                                             "axis", n[7], n[8], n[9])
                                 : json_pack("{s:{s:s,s:f,s:[f,f,f]}}", "path", "type", "line",
                                             "period", n[3], "to", n[4], n[5], n[6]);
    char error[SCENE_ERROR_SIZE] = "";
    struct reader reader = {.file = "fuzz", .path = "$", .error = error};
    CHECK(object);
    scene_read_path(&reader, object, shape.position, &shape.path);
    json_decref(object);
    CHECK(reader.failed == (error[0] != '\0'));
    if (!reader.failed)
        check(&shape, &n[4], n[10]);
    return 0;
}
