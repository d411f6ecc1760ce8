// Marching and shading of packets in frames that closed forms cannot draw: called by frame/tile.c.
#pragma once

#include "simd/simd.h"
#include "types/sdf.h"

struct trace_context {
    const struct prepared *scene;
    const struct view *view;
    struct local_ray *local_rays; // one per shape: the rays being marched
};

struct hit {
    vmask found;
    vfloat t; // distance along the ray
    struct point point;
    struct vec normal; // towards the ray; 0 where not found
    vfloat shape;      // a whole number; −1 where not found
    vfloat evals;      // evaluations of the scene's distance
};

struct shaded {
    struct vec color;
    struct hit hit;
};

// Packets that are marched in turns. Only lanes of `active` are marched, shaded and written; the others may hold anything.
struct ray_packets {
    struct point origin[TURNS];
    struct vec direction[TURNS];
    vmask active[TURNS];
};

// world: one per packet.
void ray_march(const struct ray_packets *rays, const struct trace_context world[TURNS],
               struct hit hit[TURNS]);
// Sets light to 1 where it reaches a ray's origin, 0 where it does not, and values between in the penumbra of a soft
// shadow. The rays go towards the light, `distance` away.
void shadow(const struct ray_packets *rays, const vfloat distance[TURNS],
            const struct trace_context world[TURNS], vfloat light[TURNS]);
// What near_hit() finds at hits that are the origins of world->local_rays. More exact than the march, which
// rounds origin and direction in the frames of all shapes.
struct hit_surroundings {
    vfloat distance, shape; // of the nearest
    vmask contact;          // another shape is within two normal steps of it
};

struct hit_surroundings near_hit(vmask found, const struct trace_context *world);
// Returns the normals of hits that are the origins of world->local_rays, and the slope there.
struct vec normal_at(struct vec direction, vmask found, const struct hit_surroundings *near,
                     const struct trace_context *world, vfloat *slope);
void trace(const struct ray_packets *rays, int bounce, const struct trace_context world[TURNS],
           struct shaded result[TURNS]);

// Fills one local_rays per shape: where the rays are, and then where they go.
static inline void set_local_origins(struct point origin, const struct prepared *scene,
                                     struct local_ray *local_rays) {
    struct vec_double at = vec_double_of(origin);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        if (s->eval != EVAL_LINEAR && s->eval != EVAL_POWER && !s->turned && !s->repeated) {
            local_rays[i].origin = point_sub(origin, s->position, s->position_lo);
            continue;
        }
        struct vec_double from = vec_double_sub(at, s->centre);
        local_rays[i].origin.x = coordinate(s, from, 0);
        if (s->eval == EVAL_LINEAR)
            continue;
        local_rays[i].origin.y = coordinate(s, from, 1);
        local_rays[i].origin.z = coordinate(s, from, 2);
        if (s->eval == EVAL_POWER)
            local_rays[i].power = power_at(from, s->radius_sq);
    }
}

static inline void set_local_directions(struct vec direction, const struct prepared *scene,
                                        struct local_ray *local_rays) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        if (s->eval == EVAL_LINEAR) {
            local_rays[i].direction.x = vec_dot(vec_set(s->normal), direction);
            continue;
        }
        local_rays[i].direction = turned(s, direction);
        if (s->eval == EVAL_POWER) {
            local_rays[i].slope =
                v_splat(2.0f) * vec_dot(local_rays[i].origin, local_rays[i].direction);
        }
    }
}

// Moves the origins along the rays by a short distance.
static inline void move_local_rays(vfloat by, const struct prepared *scene,
                                   struct local_ray *local_rays) {
    for (int i = 0; i < scene->model.shape_count; i++) {
        struct local_ray *a = &local_rays[i];
        a->origin.x = v_madd(a->direction.x, by, a->origin.x);
        if (scene->primitives[i].eval == EVAL_LINEAR)
            continue;
        a->origin.y = v_madd(a->direction.y, by, a->origin.y);
        a->origin.z = v_madd(a->direction.z, by, a->origin.z);
        if (scene->primitives[i].eval == EVAL_POWER)
            a->power = v_madd(by, by + a->slope, a->power);
    }
}

// Returns the distance to the nearest shape and sets its index (the first of equals). Lanes of `done` may hold anything.
static inline vfloat sdf(const struct local_ray *local_rays, vfloat t, const struct prepared *scene,
                         vmask done, vfloat *nearest) {
    vfloat least = v_splat(INFINITY);
    vmask live = v_not(done);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *s = &scene->primitives[i];
        vfloat distance =
            distance_to_shape(&local_rays[i], t, s, s->repeated, s->eval, s->type, live);
        *nearest = v_select(v_cmp_lt(distance, least), v_splat(s->index), *nearest);
        least = v_min(distance, least);
    }
    return least;
}
