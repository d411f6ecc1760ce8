// The light on a hit: B. T. Phong, "Illumination for computer generated pictures", CACM 18 (1975).
#pragma once

#include "core/packet_group.h"
#include "core/shape_distances.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "groups/field_part.h"

#include "packet/phong.h" // needs the others

// Takes the materials of hits on groups from the programs' parts. The hits are the origins of the packet's rays.
static inline void gather_groups(vfloat shape, vmask found, const struct prepared *scene,
                                 const struct packet_rays *packet, struct materials *all) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        vmask here = v_and(found, v_cmp_eq(shape, v_splat((float)i)));
        if (scene->primitives[i].eval != EVAL_FIELD || !v_any(here))
            continue;
        struct field_part part = field_at_origin(&packet->local[i], &scene->primitives[i], here);
        struct materials mixed = {part.color, part.reflectivity, part.shininess};
        mix_materials(here, &mixed, all);
    }
}

static inline struct materials gather(vfloat shape, vmask found, const struct prepared *scene,
                                      const struct packet_rays *packet) {
    struct materials all = materials_of(shape, found, &scene->model);
    if (scene->groups)
        gather_groups(shape, found, scene, packet, &all);
    return all;
}

static inline struct vec light_at(struct vec n, struct vec direction, const struct lighting *light,
                                  vfloat shadow, const struct materials *surface,
                                  const struct view *view) {
    struct vec color = vec_scale(surface->color, v_splat(0.01f)); // ambient
    if (!v_any(light->front))
        return color;
    const double *e = view->light_emission;
    struct vec emission = {v_splat((float)e[0]), v_splat((float)e[1]), v_splat((float)e[2])};
    struct vec bright = lit_color(n, direction, light->to_light, light->facing,
                                  shadow / light->distance, surface, emission, color);
    return vec_select(light->front, bright, color);
}

// Marches the rays of `size` packets and lights their hits, without mirrors and fog. Each array has one element per
// packet.
static inline void light_hits(const struct ray_group *rays, int size, struct trace_context *world,
                              struct hit *hit, struct lighting *light, struct materials *surface,
                              vfloat *reach, struct shaded *result) {
    struct vec background = vec_from_doubles(world->scene->model.background);
    ray_march(rays, world, hit);
    for (int k = 0; k < size; k++) {
        light[k].front = v_mask_none();
        surface[k] = (struct materials){0};
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
