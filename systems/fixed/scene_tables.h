// The scene in the phase's numbers: one table per property, indexed by sphere, and the frame's camera and light.
#pragma once

#include "frame/frame.h"
#include "number/format.h"
#include "number/scalar.h"
#include "scene/scene.h"

enum { BLOCK = 16 }; // side of a block in pixels, as in the article

struct scene_tables {
    struct format format;
    int count; // spheres
    // Set by tables_set_shapes. A mirror's weight is what its reflection counts.
    scalar *centre[3], *radius_sq, *colour[3], *mirror_weight, *shininess;
    int shininess_bits; // of the largest
    int bounces;
    bool shadows, mirrors;
    scalar surface_offset; // of a secondary ray's start from its surface
    scalar ambient, specular, one;
    scalar background[3];
    float exact_background[3];
    // Set by tables_set_view. For camera rays with the unit direction d and b = d·eye the discriminant is
    // b² + minus_c: eye = camera − centre, minus_c = radius² − |eye|².
    scalar *eye[3], *minus_c;
    int *blocks
        [4]; // first and last column, first and last row of the blocks that may see the sphere
    scalar light[3], emission[3], position[3];
    scalar forward[3], right[3], up[3];
    // Half of a pixel's side, one unit ahead. A product with it is shifted right by half_pixel_shift.
    scalar half_pixel;
    int half_pixel_shift;
};

// Allocates the tables of `count` spheres. Returns false when memory is short.
bool tables_create(struct scene_tables *scene, int count);
void tables_free(struct scene_tables *scene);

// Converts shapes, materials and limits. scene->format must be set; the conversion is in doubles, as in the article.
void tables_set_shapes(struct scene_tables *scene, const struct model *model);

// Converts camera and light of a frame, and what the camera rays' equations have in common.
// Also finds the blocks that may see each sphere, if the format's `clear` needs them.
void tables_set_view(struct scene_tables *scene, const struct model *model, const struct view *view,
                     const struct frame *frame);

// Converts the camera's basis (camera.c): forward, right, up, half_pixel.
void set_camera_basis(struct scene_tables *scene, const struct view *view,
                      const struct frame *frame);
