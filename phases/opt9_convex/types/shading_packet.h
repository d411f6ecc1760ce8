// A packet of camera or mirror rays: the rays, their hits, surfaces and light.
#pragma once

#include "simd/simd.h"
#include "types/known_scene.h"

// The nearest hits of a packet so far.
struct surface_hit {
    vmask found;
    vfloat t, shape;  // infinite and −1 where nothing is hit
    struct vec local; // the point in the shape's frame; not set for planes
};

// share: the weight of the mirror ray. shine_from: see struct primitive.
struct surface {
    struct vec normal, color;
    vfloat share, shininess, shine_from;
};

// Replaces the hits of the lanes in `met` by hits on s at distance t.
INLINE void take_hit(vmask met, vfloat t, struct vec local, const struct primitive *s,
                     struct surface_hit *hit) {
    if (!v_any(met))
        return;
    hit->found = v_or(hit->found, met);
    hit->t = v_select(met, t, hit->t);
    hit->shape = v_select(met, v_splat(s->index), hit->shape);
    hit->local = vec_select(met, local, hit->local);
}

// Sets no hit in any lane. Member by member: copying a struct whose mask was just written stalls on store
// forwarding.
static inline void no_hit(struct surface_hit *hit) {
    hit->found = v_mask_none();
    hit->t = v_splat(INFINITY);
    hit->shape = v_splat(-1.0f);
    hit->local = (struct vec){v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
}

struct packet_ray {
    struct vec origin, direction;
    vfloat weight, pixel, bounce;
    vfloat leaves; // the shape on which the ray starts, −1: none
    vmask active;
    struct vec
        local; // scenes with repeated shapes: the start in the frame of the shape that it leaves
};

// A packet from its rays to its colour. A group of packets takes each stage together, because the operations
// of one packet depend on each other and those of different packets do not.
struct shading_packet {
    struct packet_ray ray;
    struct surface_hit hit;
    struct vec point, color, to_light, light;
    struct surface surface;
    vfloat weight, facing;
    vmask front, open; // front: facing the light. open: reached by it without a march
    bool flat;         // all its hits are on the scene's first plane
    // Avoids 4 KiB aliasing between the fields of two packets.
    vfloat apart[16];
};

// Returns the background's colour, times weight.
static inline struct vec background(vfloat weight, const struct known_model *model) {
    const double *b = model->background;
    return (struct vec){weight * v_splat((float)b[0]), weight * v_splat((float)b[1]),
                        weight * v_splat((float)b[2])};
}

// A packet of camera rays and its nearest hits so far. only: the shape that all its rays hit, −1: not known.
// Without secondary rays (needs_no_secondary()), hit.local is the normal in world axes, of either sign.
struct primary_hit {
    struct vec direction;
    vmask active;
    struct surface_hit hit;
    int only;
};
