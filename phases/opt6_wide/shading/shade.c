// The colour of a ray: the hit's colour in the light, mirrors by recursion, and fog.
#include "core/trace.h"
#include "core/trace_context.h"
#include "shading/phong.h"

// Adds the mirrored colours to those of the reflective hits. The recursive call is made if one ray is reflective. The
// other rays are masked.
static void mirror(const struct ray_group *rays, int bounce, struct trace_context *world,
                   const struct surfaces surface[GROUP], struct shaded *result) {
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
    const double *b = model->background;
    struct vec background = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    struct hit hit[GROUP];
    struct lighting light[GROUP];
    struct surfaces surface[GROUP] = {0};
    vfloat reach[GROUP];
    ray_march(rays, world, hit);
    for (int k = 0; k < GROUP; k++) {
        light[k].lit = v_mask_none();
        if (!v_any(hit[k].found))
            continue;
        surface[k] = gather(hit[k].shape, hit[k].found, world->scene, &world->group->packet[k]);
        light[k] = light_from(hit[k].point, hit[k].normal, hit[k].found, world->view);
    }
    shadow(hit, light, world, reach);
    for (int k = 0; k < GROUP; k++) {
        result[k] = (struct shaded){.color = background, .hit = hit[k]};
        if (v_any(hit[k].found))
            result[k].color = light_at(hit[k].normal, rays->direction[k], &light[k], reach[k],
                                       &surface[k], world->view);
    }
    if (model->features.mirrors && bounce < model->march.max_bounces)
        mirror(rays, bounce, world, surface, result);
    for (int k = 0; k < GROUP; k++) {
        struct vec color = result[k].color;
        if (!v_any(hit[k].found))
            continue;
        if (model->features.fog) {
            struct vec p = hit[k].point.hi;
            vfloat far_sq = vec_dot(p, p);
            color = vec_scale(color, v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq)));
        }
        result[k].color = vec_select(hit[k].found, color, background);
    }
}
