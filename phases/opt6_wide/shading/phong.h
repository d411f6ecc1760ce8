// The light on a hit: B. T. Phong, "Illumination for computer generated pictures", CACM 18 (1975).
#pragma once

#include "core/packet_group.h"
#include "core/shape_distances.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "groups/field_part.h"

// The materials of a packet's hits, gathered.
struct surfaces {
    struct vec color;
    vfloat reflectivity, shininess;
};

// Takes the materials of hits on groups from the programs' parts. The hits are the origins of the packet's rays.
static inline void gather_groups(vfloat shape, vmask found, const struct prepared *scene,
                                 const struct packet_rays *packet, struct surfaces *all) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        vmask here = v_and(found, v_cmp_eq(shape, v_splat((float)i)));
        if (scene->primitives[i].eval != EVAL_FIELD || !v_any(here))
            continue;
        struct field_part part = field_at_origin(&packet->local[i], &scene->primitives[i], here);
        all->color = vec_select(here, part.color, all->color);
        all->reflectivity = v_select(here, part.reflectivity, all->reflectivity);
        all->shininess = v_select(here, part.shininess, all->shininess);
    }
}

static inline struct surfaces gather(vfloat shape, vmask found, const struct prepared *scene,
                                     const struct packet_rays *packet) {
    const struct model *model = &scene->model;
    float id[LANES], values[5][LANES];
    v_store(v_select(found, shape, v_splat(0.0f)), id);
    for (int lane = 0; lane < LANES; lane++) {
        const struct material *m = &model->materials[model->shapes[(int)id[lane]].material];
        for (int i = 0; i < 3; i++)
            values[i][lane] = (float)m->color[i];
        values[3][lane] = (float)m->reflectivity;
        values[4][lane] = (float)m->shininess;
    }
    struct surfaces all = {{v_load(values[0]), v_load(values[1]), v_load(values[2])},
                           v_load(values[3]),
                           v_load(values[4])};
    if (scene->groups)
        gather_groups(shape, found, scene, packet, &all);
    return all;
}

static inline struct vec light_at(struct vec n, struct vec direction, const struct lighting *light,
                                  vfloat shadow, const struct surfaces *surface,
                                  const struct view *view) {
    struct vec base = surface->color, color = vec_scale(base, v_splat(0.01f)); // ambient
    if (!v_any(light->lit))
        return color;
    vfloat reach = shadow / light->distance, facing = light->facing;
    // The mirrored direction is minus the paper's R.
    vfloat shine = vec_dot(vec_reflect(light->to_light, n), direction);
    vfloat specular = v_splat(0.2f) * v_pow(v_max(shine, v_splat(1e-30f)), surface->shininess);
    specular = v_select_or_zero(v_cmp_gt(shine, v_splat(0.0f)), specular);
    const double *e = view->light_emission;
    struct vec emission = {v_splat((float)e[0]), v_splat((float)e[1]), v_splat((float)e[2])};
    struct vec bright = {v_madd(emission.x * v_madd(base.x, facing, specular), reach, color.x),
                         v_madd(emission.y * v_madd(base.y, facing, specular), reach, color.y),
                         v_madd(emission.z * v_madd(base.z, facing, specular), reach, color.z)};
    return vec_select(light->lit, bright, color);
}

// Marches the rays of `size` packets and lights their hits, without mirrors and fog. Each array has one element per
// packet.
static inline void light_hits(const struct ray_group *rays, int size, struct trace_context *world,
                              struct hit *hit, struct lighting *light, struct surfaces *surface,
                              vfloat *reach, struct shaded *result) {
    struct vec background = vec_from_doubles(world->scene->model.background);
    ray_march(rays, world, hit);
    for (int k = 0; k < size; k++) {
        light[k].lit = v_mask_none();
        surface[k] = (struct surfaces){0};
        if (!v_any(hit[k].found))
            continue;
        surface[k] = gather(hit[k].shape, hit[k].found, world->scene, &world->group->packet[k]);
        light[k] = light_from(hit[k].point, hit[k].normal, hit[k].found, world->view);
    }
    shadow(hit, light, world, reach);
    for (int k = 0; k < size; k++) {
        result[k] = (struct shaded){.color = background, .hit = hit[k]};
        if (v_any(hit[k].found))
            result[k].color = light_at(hit[k].normal, rays->direction[k], &light[k], reach[k],
                                       &surface[k], world->view);
    }
}

// Adds fog to the hits' colours, and sets that of the rays that hit nothing.
static inline void add_fog(int size, const struct model *model, struct shaded *result) {
    struct vec background = vec_from_doubles(model->background);
    for (int k = 0; k < size; k++) {
        const struct hit *hit = &result[k].hit;
        struct vec color = result[k].color;
        if (!v_any(hit->found))
            continue;
        if (model->features.fog) {
            struct vec p = hit->point.hi;
            vfloat far_sq = vec_dot(p, p);
            color = vec_scale(color, v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq)));
        }
        result[k].color = vec_select(hit->found, color, background);
    }
}
