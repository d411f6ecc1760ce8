// How a worker's memory is divided.
#include "cones/march_scratch.h"
#include "core/ray_queues.h"
#include "core/shape_distances.h"

static size_t even_count(int shapes) { // so many that whole numbers behind masks are aligned
    return ((size_t)shapes + 1) / 2 * 2;
}

size_t march_scratch_size(int shapes) {
    return even_count(shapes) *
           ((GROUP + 1) * (sizeof(struct local_ray) + sizeof(vfloat)) + GROUP * sizeof(vfloat) +
            sizeof(struct local_ray) + (STRIP_TILES + 1) * sizeof(vmask) + 8 * sizeof(int) +
            sizeof(bool));
}

struct march_scratch march_scratch_of(void *memory, int shapes) {
    size_t n = even_count(shapes);
    struct march_scratch own = {.wake = memory};
    own.approach = (struct local_ray *)(own.wake + GROUP * n);
    own.eye_wake = (vfloat *)(own.approach + GROUP * n);
    own.eye = (struct local_ray *)(own.eye_wake + GROUP * n);
    own.distance = (vfloat *)(own.eye + n);
    own.axis = (struct local_ray *)(own.distance + n);
    own.met = (vmask *)(own.axis + n);
    own.offered = (int *)(own.met + (STRIP_TILES + 1) * n);
    own.tile = own.offered + 2 * n;
    own.mirror = own.tile + 2 * n;
    own.shadow = own.mirror + 2 * n;
    own.wanted = (bool *)(own.shadow + 2 * n);
    return own;
}
