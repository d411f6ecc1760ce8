// What core/tile.c, march/march.c, shading/shade.c and shadow/soft_shadow.c call of each other.
#ifndef TRACE_H
#define TRACE_H

#include "core/sdf.h"
#include "march/march_step.h"
#include "simd/point.h"

struct worker_scratch; // core/ray_queues.h

struct trace_context {
    const struct prepared *scene;
    const struct view *view;
    struct packet_group group; // of the rays being marched now
    struct march_scratch *own; // the worker's (cones/tile_cones.h)
    struct point eye;
    bool lone; // camera rays go by bulb/bulb_single.c
    struct worker_scratch *scratch;
};

// NULL: there is none.
static inline const struct primitive *single_shape(enum shape_type type,
                                                   const struct prepared *scene) {
    for (int i = 0; i < scene->model.shape_count; i++)
        if (scene->placed[i].type == type)
            return &scene->placed[i];
    return NULL;
}

// Only lanes of `active` are marched, shaded and written; the others may hold anything.
struct ray_group {
    struct point origin[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
    vfloat weight[GROUP]; // of what they see in their pixel
    vfloat pixel[GROUP], bounce[GROUP];
    vfloat start;             // where they begin
    struct shape_list others; // what those of them can meet that no Mandelbulb is before
    int marched;              // the pixel of the first, if the desk knows where they end; else −1
};

struct hit {
    vmask found;
    vfloat t; // distance along the ray
    struct point point;
    struct vec normal; // towards the ray; 0 where not found
    vmask smooth;      // the normal is the shape's own there, and points out of it
    vfloat shape;      // a whole number; −1 where not found
    vfloat evals;      // evaluations of the scene's distance
};

// The packets that have a live ray, and what of a ray that has none would wake a shape.
void start_packets(struct packet_group *group);

void ray_march(const struct ray_group *rays, struct trace_context *world, struct hit hit[GROUP]);

// What a hit's place says, once it is the origin of its beam: more exactly than the march,
// which has rounded origin and direction in the frames of all shapes.
struct hit_surroundings {
    vfloat distance, shape; // of the nearest
    vmask contact;          // another shape is within two normal steps of it
};

struct hit_surroundings near_hit(vmask found, const struct prepared *scene,
                                 struct packet_rays *beam);
// Of hits that are the origins of the beam, and the slope there; `smooth` as in struct hit.
struct vec normal_at(struct vec direction, vmask found, const struct hit_surroundings *near,
                     const struct prepared *scene, const struct packet_rays *beam, vfloat *slope,
                     vmask *smooth);

// What the rays see, times their weight, but for what has to wait: shadow and mirror rays are queued.
void trace(const struct ray_group *rays, struct trace_context *world, struct vec color[GROUP],
           struct hit hit[GROUP]);

#endif
