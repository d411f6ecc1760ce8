// How a worker's memory is divided.
#include "cones/march_scratch.h"
#include "core/local_rays.h"
#include "core/ray_queues.h"
#include "groups/choice.h"

// Rounds up to an even count, so that the lists behind the masks are aligned.
static size_t even_count(int shapes) {
    return ((size_t)shapes + 1) / 2 * 2;
}

static size_t size_without_regions(int shapes) {
    return even_count(shapes) *
           ((GROUP + 1) * (sizeof(struct local_ray) + sizeof(vfloat)) + GROUP * sizeof(vfloat) +
            sizeof(struct local_ray) + (STRIP_TILES + 1) * sizeof(vmask) + 8 * sizeof(int) +
            sizeof(bool));
}

size_t march_scratch_size(const struct model *model) {
    size_t regions = regions_size(model, GROUP + 2);
    return size_without_regions(model->shape_count) + (regions ? regions + 63 : 0);
}

// Gives the rays of groups their regions, behind all else.
static void place_all_regions(void *memory, const struct model *model,
                              const struct march_scratch *scratch) {
    struct local_ray *local[GROUP + 2];
    for (int k = 0; k < GROUP; k++)
        local[k] = scratch->local + k * model->shape_count;
    local[GROUP] = scratch->probe;
    local[GROUP + 1] = scratch->axis;
    size_t behind = (size_without_regions(model->shape_count) + 63) / 64 * 64;
    place_regions((char *)memory + behind, model, local, GROUP + 2);
}

struct march_scratch march_scratch_of(void *memory, const struct model *model) {
    size_t n = even_count(model->shape_count);
    struct march_scratch scratch = {.wake = memory};
    scratch.local = (struct local_ray *)(scratch.wake + GROUP * n);
    scratch.probe_wake = (vfloat *)(scratch.local + GROUP * n);
    scratch.probe = (struct local_ray *)(scratch.probe_wake + GROUP * n);
    scratch.distance = (vfloat *)(scratch.probe + n);
    scratch.axis = (struct local_ray *)(scratch.distance + n);
    scratch.met = (vmask *)(scratch.axis + n);
    scratch.offered = (int *)(scratch.met + (STRIP_TILES + 1) * n);
    scratch.patch = scratch.offered + 2 * n;
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
