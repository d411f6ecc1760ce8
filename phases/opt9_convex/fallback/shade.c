// Shades marched rays: light (B. T. Phong, "Illumination for computer generated pictures", CACM 18 (1975)),
// mirrors by recursion, fog.
#include "fallback/trace.h"
#include "simd/simd.h"

#include "packet/phong.h" // needs simd.h

// A group's materials are mixed in its blends. Precondition: the hits are the origins of world->local_rays.
static void gather_group(int i, vfloat shape, vmask found, const struct trace_context *world,
                         struct materials *all) {
    vmask same = v_cmp_lt(v_abs(shape - v_splat((float)i)), v_splat(0.5f));
    const struct primitive *s = &world->scene->primitives[i];
    if (s->type != SHAPE_GROUP || !v_any(v_and(same, found)))
        return;
    struct vec p = world->local_rays[i].origin;
    if (s->repeated)
        p = vec_wrapped(s, p);
    struct field_surface at = field_surface(s->field, p, v_and(same, found));
    struct materials mixed = {at.color, at.reflectivity, at.shininess};
    mix_materials(same, &mixed, all);
}

static struct materials gather(vfloat shape, vmask found, const struct trace_context *world) {
    const struct model *model = &world->scene->model;
    struct materials mixed = materials_of(shape, found, model);
    for (int i = 0; i < model->shape_count && model->features.groups; i++)
        gather_group(i, shape, found, world, &mixed);
    return mixed;
}

static struct vec from_to(struct point from, const double to[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(to[i], &hi[i], &lo[i]);
    return vec_scale(point_sub(from, hi, lo), v_splat(-1.0f));
}

// Sets the colours of hits, without mirrors and fog.
static void light_hits(const struct hit hit[TURNS], const struct vec direction[TURNS],
                       const struct materials surface[TURNS],
                       const struct trace_context world[TURNS], struct vec color[TURNS]) {
    struct ray_packets rays;
    vfloat distance[TURNS], facing[TURNS], light[TURNS], zero = v_splat(0.0f);
    for (int k = 0; k < TURNS; k++) {
        struct vec to_light = from_to(hit[k].point, world->view->light_position);
        distance[k] = vec_norm(to_light);
        rays.origin[k] = hit[k].point;
        rays.direction[k] = vec_scale(to_light, v_splat(1.0f) / distance[k]);
        facing[k] = vec_dot(hit[k].normal, rays.direction[k]);
        // Facing away from the light, both terms are 0 whatever the shadow. A point at the light has no direction
        // to it.
        rays.active[k] =
            v_and(hit[k].found, v_and(v_cmp_gt(facing[k], zero), v_cmp_gt(distance[k], zero)));
    }
    shadow(&rays, distance, world, light);
    struct vec emission = vec_from_doubles(world->view->light_emission);
    for (int k = 0; k < TURNS; k++) {
        struct vec ambient = vec_scale(surface[k].color, v_splat(0.01f));
        vfloat reach = light[k] / distance[k];
        struct vec bright = lit_color(hit[k].normal, direction[k], rays.direction[k], facing[k],
                                      reach, &surface[k], emission, ambient);
        color[k] = vec_select(rays.active[k], bright, ambient);
    }
}

// Adds what mirrors show.
static void add_mirrored(const struct hit hit[TURNS], const struct vec direction[TURNS], int bounce,
                         const struct materials surface[TURNS],
                         const struct trace_context world[TURNS], struct vec color[TURNS]) {
    vfloat zero = v_splat(0.0f);
    vfloat offset = v_splat((float)world->scene->model.march.surface_offset);
    struct ray_packets next;
    struct shaded seen[TURNS];
    vmask any = v_mask_none();
    for (int k = 0; k < TURNS; k++) {
        next.origin[k] = point_at(hit[k].point, hit[k].normal, offset, zero);
        next.direction[k] = vec_reflect(direction[k], hit[k].normal);
        next.active[k] = v_and(hit[k].found, v_cmp_gt(surface[k].reflectivity, zero));
        any = v_or(any, next.active[k]);
    }
    if (!v_any(any))
        return;
    // One reflective ray makes the call; the others are masked out of it and of its colour.
    trace(&next, bounce + 1, world, seen);
    for (int k = 0; k < TURNS; k++) {
        vmask mirror = next.active[k];
        vfloat share = v_select_or_zero(mirror, surface[k].reflectivity * v_splat(0.1f));
        color[k] = vec_along(color[k], vec_select(mirror, seen[k].color, color[k]), share);
    }
}

void trace(const struct ray_packets *rays, int bounce, const struct trace_context world[TURNS],
           struct shaded result[TURNS]) {
    const struct model *model = &world->scene->model;
    const double *b = model->background;
    struct vec background = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    struct hit hit[TURNS];
    struct materials surface[TURNS];
    struct vec color[TURNS];
    ray_march(rays, world, hit);
    vmask found = v_mask_none();
    for (int k = 0; k < TURNS; k++) {
        found = v_or(found, hit[k].found);
        result[k] = (struct shaded){background, hit[k]};
        surface[k] = gather(hit[k].shape, hit[k].found, &world[k]);
    }
    if (!v_any(found))
        return;
    light_hits(hit, rays->direction, surface, world, color);
    if (model->features.mirrors && bounce < model->march.max_bounces)
        add_mirrored(hit, rays->direction, bounce, surface, world, color);
    for (int k = 0; k < TURNS; k++) {
        if (model->features.fog) {
            vfloat far_sq = vec_dot(hit[k].point.hi, hit[k].point.hi);
            color[k] =
                vec_scale(color[k], v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq)));
        }
        result[k].color = vec_select(hit[k].found, color[k], background);
    }
}
