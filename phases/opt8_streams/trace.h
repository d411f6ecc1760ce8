// What tile.c, march.c, shade.c and umbra.c call of each other.
#ifndef TRACE_H
#define TRACE_H

#include "marching.h"
#include "sdf.h"
#include "simd/point.h"

struct desk; // streams.h

struct world {
    const struct prepared *scene;
    const struct view *view;
    struct group group; // of the rays being marched now
    struct own *own;    // the worker's (tiles.h)
    struct point eye;
    bool lone; // camera rays go by lone.c
    struct desk *desk;
};

// NULL: there is none.
static inline const struct placed *the_one(enum shape_type type, const struct prepared *scene) {
    for (int i = 0; i < scene->model.shape_count; i++)
        if (scene->placed[i].type == type)
            return &scene->placed[i];
    return NULL;
}

// Only lanes of `active` are marched, shaded and written; the others may hold anything.
struct rays {
    struct point origin[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
    vfloat weight[GROUP]; // of what they see in their pixel
    vfloat pixel[GROUP], bounce[GROUP];
    vfloat start;       // where they begin
    struct list others; // what those of them can meet that no Mandelbulb is before
    int marched;        // the pixel of the first, if the desk knows where they end; else −1
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
void set_out(struct group *group);

void ray_march(const struct rays *rays, struct world *world, struct hit hit[GROUP]);

// What a hit's place says, once it is the origin of its beam: more exactly than the march,
// which has rounded origin and direction in the frames of all shapes.
struct nearness {
    vfloat distance, shape; // of the nearest
    vmask contact;          // another shape is within two normal steps of it
};

struct nearness near_hit(vmask found, const struct prepared *scene, struct beam *beam);
// Of hits that are the origins of the beam, and the slope there; `smooth` as in struct hit.
struct vec normal_at(struct vec direction, vmask found, const struct nearness *near,
                     const struct prepared *scene, const struct beam *beam, vfloat *slope,
                     vmask *smooth);

// What the rays see, times their weight, but for what has to wait: shadow and mirror rays are queued.
void trace(const struct rays *rays, struct world *world, struct vec color[GROUP],
           struct hit hit[GROUP]);

#endif
