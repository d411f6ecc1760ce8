// Shades marched rays: light (B. T. Phong, "Illumination for computer generated pictures", CACM 18 (1975)),
// mirrors by recursion, fog.
#include "fallback/trace.h"
#include "simd/simd.h"

// The materials of a packet's hits.
struct surfaces {
    struct vec color;
    vfloat reflectivity, shininess;
};

// A group's materials are mixed in its blends. Precondition: the hits are the origins of world->local_rays.
static void gather_group(int i, vfloat shape, vmask found, const struct trace_context *world,
                         struct surfaces *all) {
    vmask same = v_cmp_lt(v_abs(shape - v_splat((float)i)), v_splat(0.5f));
    const struct primitive *s = &world->scene->primitives[i];
    if (s->type != SHAPE_GROUP || !v_any(v_and(same, found)))
        return;
    struct vec p = world->local_rays[i].origin;
    if (s->repeated)
        p = vec_wrapped(s, p);
    struct field_surface at = field_surface(s->field, p, v_and(same, found));
    all->color = vec_select(same, at.color, all->color);
    all->reflectivity = v_select(same, at.reflectivity, all->reflectivity);
    all->shininess = v_select(same, at.shininess, all->shininess);
}

static struct surfaces gather(vfloat shape, vmask found, const struct trace_context *world) {
    const struct model *model = &world->scene->model;
    float id[LANES], values[5][LANES];
    struct surfaces mixed;
    v_store(v_select(found, shape, v_splat(0.0f)), id);
    for (int lane = 0; lane < LANES; lane++) {
        const struct material *m = &model->materials[model->shapes[(int)id[lane]].material];
        for (int i = 0; i < 3; i++)
            values[i][lane] = (float)m->color[i];
        values[3][lane] = (float)m->reflectivity;
        values[4][lane] = (float)m->shininess;
    }
    mixed = (struct surfaces){{v_load(values[0]), v_load(values[1]), v_load(values[2])},
                              v_load(values[3]),
                              v_load(values[4])};
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

static struct vec light_at(struct point p, struct vec n, struct vec direction, vmask found,
                           const struct surfaces *surface, const struct trace_context *world) {
    vfloat zero = v_splat(0.0f);
    struct vec base = surface->color;
    struct vec to_light = from_to(p, world->view->light_position);
    vfloat distance = vec_norm(to_light);
    to_light = vec_scale(to_light, v_splat(1.0f) / distance);
    vfloat facing = vec_dot(n, to_light);
    // Facing away from the light, both terms are 0 whatever the shadow. A point at the light has no direction
    // to it.
    vmask front = v_and(found, v_and(v_cmp_gt(facing, zero), v_cmp_gt(distance, zero)));
    struct vec color = vec_scale(base, v_splat(0.01f)); // ambient
    if (!v_any(front))
        return color;
    vfloat reach = shadow(p, to_light, distance, front, world) / distance;
    // Reflects the light's direction, where the paper has R = −that.
    vfloat shine = vec_dot(vec_reflect(to_light, n), direction);
    vfloat specular = v_splat(0.2f) * v_pow(v_max(shine, v_splat(1e-30f)), surface->shininess);
    specular = v_select_or_zero(v_cmp_gt(shine, zero), specular);
    const double *e = world->view->light_emission;
    struct vec emission = {v_splat((float)e[0]), v_splat((float)e[1]), v_splat((float)e[2])};
    struct vec bright = {v_madd(emission.x * v_madd(base.x, facing, specular), reach, color.x),
                         v_madd(emission.y * v_madd(base.y, facing, specular), reach, color.y),
                         v_madd(emission.z * v_madd(base.z, facing, specular), reach, color.z)};
    return vec_select(front, bright, color);
}

void trace(struct point origin, struct vec direction, vmask active, int bounce,
           const struct trace_context *world, struct shaded *result) {
    const struct model *model = &world->scene->model;
    const double *b = model->background;
    struct vec background = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    *result = (struct shaded){.color = background};
    ray_march(origin, direction, active, world, &result->hit);
    vmask found = result->hit.found;
    if (!v_any(found))
        return;
    struct point p = result->hit.point;
    struct vec n = result->hit.normal;
    struct surfaces surface = gather(result->hit.shape, found, world);
    struct vec color = light_at(p, n, direction, found, &surface, world);
    if (model->features.mirrors && bounce < model->march.max_bounces) {
        // One reflective ray makes the call; the others are masked out of it and of its colour.
        vmask mirror = v_and(found, v_cmp_gt(surface.reflectivity, v_splat(0.0f)));
        if (v_any(mirror)) {
            struct point start =
                point_at(p, n, v_splat((float)model->march.surface_offset), v_splat(0.0f));
            struct shaded seen;
            trace(start, vec_reflect(direction, n), mirror, bounce + 1, world, &seen);
            vfloat share = v_select_or_zero(mirror, surface.reflectivity * v_splat(0.1f));
            color = vec_along(color, vec_select(mirror, seen.color, color), share);
        }
    }
    if (model->features.fog) {
        vfloat far_sq = vec_dot(p.hi, p.hi);
        color = vec_scale(color, v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq)));
    }
    result->color = vec_select(found, color, background);
}
