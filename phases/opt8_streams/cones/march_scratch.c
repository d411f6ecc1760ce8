// How a worker's memory is divided.
#include "cones/march_scratch.h"
#include "core/ray_queues.h"
#include "core/shape_distances.h"

// Rounds up to an even count, so that the lists behind the masks are aligned.
static size_t even_count(int shapes) {
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
    return scratch;
}
