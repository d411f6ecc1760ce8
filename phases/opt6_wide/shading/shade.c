// The colour of a ray: the hit's colour in the light, mirrors by recursion, and fog.
#include "core/trace.h"
#include "core/trace_context.h"
#include "shading/phong.h"

// Adds the mirrored colours to those of the reflective hits. The recursive call is made if one ray is reflective. The
// other rays are masked.
static void mirror(const struct ray_group *rays, int bounce, struct trace_context *world,
                   const struct materials surface[GROUP], struct shaded *result) {
    struct ray_group mirrored;
    bool one = false;
    for (int k = 0; k < GROUP; k++) {
        const struct hit *hit = &result[k].hit;
        vmask active = v_and(hit->found, v_cmp_gt(surface[k].reflectivity, v_splat(0.0f)));
        mirrored.active[k] = active;
        if (!v_any(active))
            continue;
        one = true;
        vfloat offset = v_splat((float)world->scene->model.march.surface_offset);
        mirrored.origin[k] = point_at(hit->point, hit->normal, offset, v_splat(0.0f));
        mirrored.direction[k] = vec_reflect(rays->direction[k], hit->normal);
    }
    if (!one)
        return;
    struct shaded seen[GROUP];
    trace(&mirrored, bounce + 1, world, seen);
    for (int k = 0; k < GROUP; k++) {
        vmask active = mirrored.active[k];
        if (!v_any(active))
            continue;
        vfloat share = v_select_or_zero(active, surface[k].reflectivity * v_splat(0.1f));
        struct vec color = result[k].color;
        result[k].color = vec_along(color, vec_select(active, seen[k].color, color), share);
    }
}

void trace(const struct ray_group *rays, int bounce, struct trace_context *world,
           struct shaded *result) {
    const struct model *model = &world->scene->model;
    struct hit hit[GROUP];
    struct lighting light[GROUP];
    struct materials surface[GROUP];
    vfloat reach[GROUP];
    light_hits(rays, GROUP, world, hit, light, surface, reach, result);
    if (model->features.mirrors && bounce < model->march.max_bounces)
        mirror(rays, bounce, world, surface, result);
    add_fog(GROUP, model, result);
}
