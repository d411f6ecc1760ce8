// Fuzzes the scene loader (common/scene): any bytes are loaded or refused by one line, and a loaded scene keeps
// what scene.h promises. libFuzzer: llvm.org/docs/LibFuzzer.html.
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene/scene.h"
#include "scene/vector.h"

#define CHECK(condition) ((condition) ? (void)0 : broken(#condition, __LINE__))
enum { LARGEST_NUMBER = 1000000000 }; // common/scenes/README.md

static void broken(const char *condition, int line) {
    fprintf(stderr, "scene.c:%d: does not hold: %s\n", line, condition);
    abort();
}

static bool within(const double v[3], double limit) {
    return fabs(v[0]) <= limit && fabs(v[1]) <= limit && fabs(v[2]) <= limit; // false for NaN
}

static void check_view(const struct view *view, double limit) {
    const double *axes[] = {view->right, view->up, view->forward};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            CHECK(fabs(dot3(axes[i], axes[k]) - (i == k)) < 1e-9);
    CHECK(within(view->position, limit) && within(view->light_position, LARGEST_NUMBER));
    CHECK(view->tan_half_fov > 0 && isfinite(view->tan_half_fov));
}

static void check_shape(const struct shape *shape, const struct model *model) {
    CHECK(shape->type < SHAPE_TYPES && shape->material >= 0 &&
          shape->material < model->material_count);
    CHECK(within(shape->position, LARGEST_NUMBER));
    for (int i = 0; i < 3; i++)
        CHECK(shape->repeat[i] >= 0 && shape->repeat[i] <= LARGEST_NUMBER);
    if (shape->type == SHAPE_PLANE)
        CHECK(fabs(dot3(shape->plane.normal, shape->plane.normal) - 1) < 1e-9);
    if (shape->type == SHAPE_GROUP)
        CHECK(shape->group.root < model->node_count);
    if (shape->path.type == PATH_CIRCLE)
        CHECK(fabs(dot3(shape->path.axis, shape->path.axis) - 1) < 1e-9);
}

// Every position of an animation is finite, and near what the format allows.
static void check_motion(const struct model *model, double seconds) {
    struct model moved;
    CHECK(model_copy(model, &moved));
    model_move(model, seconds, &moved);
    for (int i = 0; i < model->shape_count; i++) {
        CHECK(within(moved.shapes[i].position, 4.0 * LARGEST_NUMBER));
        if (model->shapes[i].path.type == PATH_NONE || seconds == 0)
            CHECK(memcmp(moved.shapes[i].position, model->shapes[i].position,
                         sizeof moved.shapes[i].position) == 0);
    }
    for (int i = 0; i < model->node_count; i++)
        CHECK(within(moved.nodes[i].centre, 1e12) && moved.nodes[i].lipschitz >= 1);
    free(moved.shapes);
}

// A tree's nodes are in prefix order, and its bounds are numbers.
static void check_node(const struct model *model, int i) {
    const struct node *node = &model->nodes[i];
    int children = 0, child = i + 1;
    for (; child < node->end; child = model->nodes[child].end)
        children++;
    CHECK(child == node->end && node->end <= model->node_count && children == node->children);
    CHECK((node->operation == NODE_SHAPE) == (children == 0));
    CHECK(node->shape.material >= 0 && node->shape.material < model->material_count);
    CHECK(node->lipschitz >= 1 && node->lipschitz <= 1000);
    CHECK(within(node->centre, 1e12) && node->radius > 0);
    CHECK(node->growth > 0 && node->growth <= 1);
    CHECK(node->twist == 0 || (node->twist_radius > 0 && isfinite(node->twist_radius)));
}

// The camera of an animation is a frame, or is told not to be one.
static void check_flight(const struct scene *scene, double seconds) {
    struct view view;
    enum aim aim = scene_view(scene, seconds, &view);
    CHECK(aim == AIM_OK || scene->flight.path.type != PATH_NONE);
    if (aim == AIM_OK)
        check_view(&view, 4.0 * LARGEST_NUMBER);
    CHECK(seconds != 0 || memcmp(&view, &scene->view, sizeof view) == 0);
}

static void check_error(const char *error, const char *path) {
    size_t length = strlen(error);
    CHECK(length > 0 && length < SCENE_ERROR_SIZE && strncmp(error, path, strlen(path)) == 0);
    for (size_t i = 0; i < length; i++)
        CHECK(!iscntrl((unsigned char)error[i]));
}

// The loader's fopen (fuzz.mk: --wrap=fopen): PATH is the input, in memory. libFuzzer's own files are files.
static const char PATH[] = "in/memory.json";
static struct {
    const uint8_t *data;
    size_t size;
} input;

FILE *__real_fopen(const char *path, const char *mode);
FILE *__wrap_fopen(const char *path, const char *mode);
FILE *__wrap_fopen(const char *path, const char *mode) {
    static char buffer[BUFSIZ];
    if (strcmp(path, PATH) != 0)
        return __real_fopen(path, mode);
    FILE *file = fmemopen((void *)(uintptr_t)input.data, input.size, mode);
    CHECK(file && setvbuf(file, buffer, _IOFBF, sizeof buffer) == 0);
    return file;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static char error[SCENE_ERROR_SIZE];
    input.data = data;
    input.size = size;
    struct scene scene;
    error[0] = '\0';
    if (!scene_load(PATH, NULL, &scene, error)) {
        check_error(error, PATH);
        return 0;
    }
    CHECK(scene.model.shape_count > 0 && scene.model.shape_count <= SCENE_MAX_SHAPES);
    CHECK(strlen(scene.hash) == 16);
    check_view(&scene.view, LARGEST_NUMBER);
    for (int i = 0; i < scene.model.shape_count; i++)
        check_shape(&scene.model.shapes[i], &scene.model);
    for (int i = 0; i < scene.model.node_count; i++)
        check_node(&scene.model, i);
    const double times[] = {0, 0.1, -3.7, 1e9};
    for (int i = 0; i < 4; i++) {
        check_motion(&scene.model, times[i]);
        check_flight(&scene, times[i]);
    }
    scene_free(&scene);
    return 0;
}
