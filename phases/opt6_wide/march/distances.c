// Distances at given points, for tests (common/phase.h), and with them the whole kernel of a lane width.
#include "core/kernel.h"
#include "core/local_rays.h"
#include "core/pixel_block.h"

#include <stdlib.h>

static bool distances_at(const struct prepared *prepared, size_t count, const double *points,
                         double *distance, int *nearest) {
    size_t size = scratch_size(&prepared->model);
    void *scratch = aligned_alloc(64, (size + 63) / 64 * 64);
    if (!scratch)
        return false;
    struct packet_rays rays = packet_in(scratch, prepared), *packet = &rays;
    struct vec nowhere = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (size_t i = 0; i < count; i++) {
        vfloat shape = v_splat(-1.0f);
        set_local_origins(point_from_doubles(points + 3 * i), prepared, packet);
        set_local_directions(nowhere, prepared, packet);
        distance[i] =
            v_lane0(nearest_shape_at(packet, v_splat(0.0f), prepared, v_mask_all(), &shape));
        nearest[i] = (int)v_lane0(shape);
    }
    free(scratch);
    return true;
}

const struct lane_kernel VARIANT(kernel) = {scratch_size, count_tiles, draw_tile, distances_at,
                                            NULL};
