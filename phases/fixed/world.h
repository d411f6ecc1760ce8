// A scene in numbers: tables by shape for what a lane looks up, and what a frame's camera adds.
#ifndef FIXED_WORLD_H
#define FIXED_WORLD_H

#include "format.h"
#include "frame/frame.h"
#include "scene/scene.h"

enum { BLOCK = 16 }; // pixels on a side, as in the article

struct world {
    struct format format;
    int count;
    // Of each sphere: centre, radius²; camera − centre and radius² − |camera − centre|², of this frame alone ("the
    // first bounce precomputed").
    one *centre[3], *radius_sq, *eye[3], *rest;
    one *colour[3], *mirror, *shine; // mirror: what a reflection counts; shine: a whole number
    int *reach[4]; // first and last column and row of blocks that a ray can hit it in
    int shine_bits, bounces;
    bool shadows, mirrors;
    one offset;                // where a secondary ray starts from its surface
    one ambient, fifth, whole; // 0.01, 0.2, 1
    one background[3];
    float exact_background[3];
    // Of the frame:
    one light[3], emission[3], position[3];
    one forward[3], right[3], up[3];
    one per_height; // half of a pixel's side, a unit away, in 30 bits: a place times that goes right by `finer`
    int finer;
};

bool world_create(struct world *world, int count);
void world_free(struct world *world);
void world_place(struct world *world, const struct model *model);
void world_look(struct world *world, const struct model *model, const struct view *view,
                const struct frame *frame);

#endif
