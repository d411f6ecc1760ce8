// The colour of a ray: what it hits in the light, mirrors by recursion, fog.
#include "phong.h"
#include "simd/point.h"
#include "simd/pow.h"
#include "tiles.h"

// Colours of what the reflective hits of a few packets mirror, added to theirs. One reflective ray makes the call; the
// others are masked out of it and of their colour.
static void mirror(const struct rays *rays, int bounce, struct world *world,
                   const struct surfaces *surface, struct shaded *result) {
    COUNT(mirror, call);
    struct point origin[FEW];
    struct vec direction[FEW];
    vmask activated[FEW];
    const struct rays mirrored = {origin, direction, activated, v_splat(0.0f)};
    bool one = false;
    for (int k = 0; k < FEW; k++) {
        const struct hit *hit = &result[k].hit;
        ACTIVE(v_count(hit->found));
        COUNT(mirror, packet);
        vmask active = v_and(hit->found, v_cmp_gt(surface[k].reflectivity, v_splat(0.0f)));
        activated[k] = active;
        if (!v_any(active))
            continue;
        one = true;
        ACTIVE(v_count(active));
        COUNT(mirror, start);
        vfloat offset = v_splat((float)world->scene->model.march.surface_offset);
        origin[k] = point_at(hit->point, hit->normal, offset, v_splat(0.0f));
        direction[k] = vec_reflect(rays->direction[k], hit->normal);
    }
    if (!one)
        return;
    group_size(&world->group, FEW);
    meet(&mirrored, NULL, HIT, world, world->own->mirror);
    struct shaded seen[FEW];
    trace(&mirrored, bounce + 1, world, seen);
    for (int k = 0; k < FEW; k++) {
        vmask active = activated[k];
        if (!v_any(active))
            continue;
        ACTIVE(v_count(active));
        COUNT(mirror, seen);
        vfloat share = v_select_or_zero(active, surface[k].reflectivity * v_splat(0.1f));
        struct vec color = result[k].color;
        result[k].color = vec_along(color, vec_select(active, seen[k].color, color), share);
    }
}

// The group's packets seen; the arrays have one for each.
static inline void trace_packets(const struct rays *rays, int bounce, struct world *world,
                                 struct hit *hit, struct lighting *light, struct surfaces *surface,
                                 vfloat *reach, struct shaded *result) {
    COUNT(trace, call);
    const struct model *model = &world->scene->model;
    const double *b = model->background;
    struct vec background = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    const int size = world->group.size;
    ray_march(rays, world, hit);
    for (int k = 0; k < size; k++) {
        ACTIVE(v_count(hit[k].found));
        light[k].lit = v_mask_none();
        surface[k] = (struct surfaces){0};
        if (!v_any(hit[k].found))
            continue;
        surface[k] = gather(hit[k].shape, hit[k].found, model);
        light[k] = light_from(hit[k].point, hit[k].normal, hit[k].found, world->view);
    }
    shadow(hit, light, world, reach);
    for (int k = 0; k < size; k++) {
        ACTIVE(v_count(hit[k].found));
        result[k] = (struct shaded){.color = background, .hit = hit[k]};
        if (v_any(hit[k].found))
            result[k].color = light_at(hit[k].normal, rays->direction[k], &light[k], reach[k],
                                       &surface[k], world->view);
    }
    if (model->features.mirrors && bounce < model->march.max_bounces)
        for (int first = 0; first < size; first += FEW) {
            const struct rays some = {rays->origin + first, rays->direction + first,
                                      rays->active + first, rays->start};
            mirror(&some, bounce, world, surface + first, result + first);
        }
    for (int k = 0; k < size; k++) {
        struct vec color = result[k].color;
        ACTIVE(v_count(hit[k].found));
        if (!v_any(hit[k].found))
            continue;
        if (model->features.fog) {
            COUNT(trace, fog);
            struct vec p = hit[k].point.hi;
            vfloat far_sq = vec_dot(p, p);
            color = vec_scale(color, v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq)));
        }
        result[k].color = vec_select(hit[k].found, color, background);
    }
}

// A large group is seen from the camera alone, so that as many bounces as a scene may ask for fit the stack.
__attribute__((noinline)) static void trace_many(const struct rays *rays, int bounce,
                                                 struct world *world, struct shaded *result) {
    struct hit hit[GROUP];
    struct lighting light[GROUP];
    struct surfaces surface[GROUP];
    vfloat reach[GROUP];
    trace_packets(rays, bounce, world, hit, light, surface, reach, result);
}

__attribute__((noinline)) static void trace_few(const struct rays *rays, int bounce,
                                                struct world *world, struct shaded *result) {
    struct hit hit[FEW];
    struct lighting light[FEW];
    struct surfaces surface[FEW];
    vfloat reach[FEW];
    trace_packets(rays, bounce, world, hit, light, surface, reach, result);
}

void trace(const struct rays *rays, int bounce, struct world *world, struct shaded *result) {
    if (world->group.size == FEW)
        trace_few(rays, bounce, world, result);
    else
        trace_many(rays, bounce, world, result);
}
