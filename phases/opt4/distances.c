// Distances at given points, for tests (common/phase.h).
#include <stdlib.h>

#include "phase.h"
#include "trace.h"

bool phase_distances(const struct prepared *prepared, size_t count, const double *points,
                     double *distance, int *nearest) {
    struct local_ray *rays = new_local_rays(prepared);
    if (!rays)
        return false;
    struct vec nowhere = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (size_t i = 0; i < count; i++) {
        vfloat shape = v_splat(-1.0f);
        local_ray_origins(point_from_doubles(points + 3 * i), prepared, rays);
        local_ray_directions(nowhere, prepared, rays);
        distance[i] = _mm256_cvtss_f32(sdf(rays, v_splat(0.0f), prepared, v_mask_none(),
                                           prepared->model.features.groups, &shape));
        nearest[i] = (int)_mm256_cvtss_f32(shape);
    }
    free(rays);
    return true;
}
