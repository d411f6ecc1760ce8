// How a worker's memory is divided.
#include "cones/march_scratch.h"
#include "core/shape_distances.h"

static size_t even_count(int shapes) { // so many that whole numbers behind masks are aligned
    return ((size_t)shapes + 1) / 2 * 2;
}

static int max_packets(const struct model *model) {
    for (int i = 0; i < model->shape_count; i++)
        if (model->shapes[i].type == SHAPE_MANDELBULB)
            return GROUP;
    return SMALL_GROUP;
}

size_t march_scratch_size(const struct model *model) {
    return even_count(model->shape_count) *
           ((size_t)(max_packets(model) + 2) * (sizeof(struct local_ray) + sizeof(vfloat)) +
            CONE_LEVELS * sizeof(vmask) + (6 + 2 * CONE_LEVELS) * sizeof(int) + sizeof(bool));
}

struct march_scratch march_scratch_of(void *memory, const struct model *model) {
    size_t n = even_count(model->shape_count);
    struct march_scratch own = {.packets = max_packets(model), .wake = memory};
    size_t packets = (size_t)own.packets;
    own.approach = (struct local_ray *)(own.wake + packets * n);
    own.eye_wake = (vfloat *)(own.approach + packets * n);
    own.eye = (struct local_ray *)(own.eye_wake + n);
    own.distance = (vfloat *)(own.eye + n);
    own.axis = (struct local_ray *)(own.distance + n);
    own.levels[0] = (vmask *)(own.axis + n);
    for (int level = 1; level < CONE_LEVELS; level++)
        own.levels[level] = own.levels[0] + level * n;
    own.offered[0] = (int *)(own.levels[0] + CONE_LEVELS * n);
    for (int level = 1; level < CONE_LEVELS; level++)
        own.offered[level] = own.offered[0] + 2 * level * n;
    own.tile = own.offered[0] + 2 * CONE_LEVELS * n;
    own.mirror = own.tile + 2 * n;
    own.shadow = own.mirror + 2 * n;
    own.wanted = (bool *)(own.shadow + 2 * n);
    return own;
}
