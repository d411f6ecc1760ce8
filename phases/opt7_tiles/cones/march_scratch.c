// How a worker's memory is divided.
#include "cones/march_scratch.h"
#include "core/local_rays.h"
#include "groups/choice.h"

// Rounds up to an even count, so that the lists behind the masks are aligned.
static size_t even_count(int shapes) {
    return ((size_t)shapes + 1) / 2 * 2;
}

static int max_packets(const struct model *model) {
    for (int i = 0; i < model->shape_count; i++)
        if (is_fractal(model->shapes[i].type))
            return GROUP;
    return SMALL_GROUP;
}

static size_t size_without_regions(const struct model *model) {
    return even_count(model->shape_count) *
           ((size_t)(max_packets(model) + 2) * (sizeof(struct local_ray) + sizeof(vfloat)) +
            CONE_LEVELS * sizeof(vmask) + (6 + 2 * CONE_LEVELS) * sizeof(int) + sizeof(bool));
}

size_t march_scratch_size(const struct model *model) {
    size_t regions = regions_size(model, max_packets(model) + 2);
    return size_without_regions(model) + (regions ? regions + 63 : 0);
}

// Gives the rays of groups their regions, behind all else.
static void place_all_regions(void *memory, const struct model *model,
                              const struct march_scratch *scratch) {
    struct local_ray *local[GROUP + 2];
    for (int k = 0; k < scratch->packets; k++)
        local[k] = scratch->local + k * model->shape_count;
    local[scratch->packets] = scratch->probe;
    local[scratch->packets + 1] = scratch->axis;
    size_t behind = (size_without_regions(model) + 63) / 64 * 64;
    place_regions((char *)memory + behind, model, local, scratch->packets + 2);
}

struct march_scratch march_scratch_of(void *memory, const struct model *model) {
    size_t n = even_count(model->shape_count);
    struct march_scratch scratch = {.packets = max_packets(model), .wake = memory};
    size_t packets = (size_t)scratch.packets;
    scratch.local = (struct local_ray *)(scratch.wake + packets * n);
    scratch.probe_wake = (vfloat *)(scratch.local + packets * n);
    scratch.probe = (struct local_ray *)(scratch.probe_wake + n);
    scratch.distance = (vfloat *)(scratch.probe + n);
    scratch.axis = (struct local_ray *)(scratch.distance + n);
    scratch.levels[0] = (vmask *)(scratch.axis + n);
    for (int level = 1; level < CONE_LEVELS; level++)
        scratch.levels[level] = scratch.levels[0] + level * n;
    scratch.offered[0] = (int *)(scratch.levels[0] + CONE_LEVELS * n);
    for (int level = 1; level < CONE_LEVELS; level++)
        scratch.offered[level] = scratch.offered[0] + 2 * level * n;
    scratch.patch = scratch.offered[0] + 2 * CONE_LEVELS * n;
    scratch.mirror = scratch.patch + 2 * n;
    scratch.shadow = scratch.mirror + 2 * n;
    scratch.wanted = (bool *)(scratch.shadow + 2 * n);
    if (model->features.groups > 0)
        place_all_regions(memory, model, &scratch);
    return scratch;
}

struct packet_rays packet_in(void *scratch, const struct prepared *scene) {
    struct march_scratch parts = march_scratch_of(scratch, &scene->model);
    return single_packet(parts.local, scene->all, parts.wake);
}
