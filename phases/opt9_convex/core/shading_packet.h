// A packet of rays on its way to a colour.
#ifndef OPT9_SHADING_PACKET_H
#define OPT9_SHADING_PACKET_H

#include "core/known_scene.h"
#include "simd/vec.h"

struct tile_context;

struct surface_hit {
    vmask found;
    vfloat t, shape;
    struct vec local; // in the shape's frame; not for planes
};

struct surface {
    struct vec normal, color;
    vfloat share, shininess, shine_from;
};

INLINE void take_hit(vmask met, vfloat t, struct vec local, const struct primitive *s,
                     struct surface_hit *hit) {
    if (!v_any(met))
        return;
    hit->found = v_or(hit->found, met);
    hit->t = v_select(met, t, hit->t);
    hit->shape = v_select(met, v_splat(s->index), hit->shape);
    hit->local = vec_select(met, local, hit->local);
}

// Part by part, as rays and hits are below: a mask that was just written, copied as a part of a whole register, is waited
// for.
static inline void no_hit(struct surface_hit *hit) {
    hit->found = v_mask_none();
    hit->t = v_splat(INFINITY);
    hit->shape = v_splat(-1.0f);
    hit->local = (struct vec){v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
}

struct packet_ray {
    struct vec origin, direction;
    vfloat weight, pixel, bounce, leaves; // leaves: the shape it is from, −1: none
    vmask active;
    struct vec
        local; // where repeated shapes are: the point it is from, in the frame of what it leaves
};

// A group of them takes each step together: each packet's steps wait
// for each other, those of different packets do not.
struct shading_packet {
    struct packet_ray ray;
    struct surface_hit hit;
    struct vec point, color, to_light, light;
    struct surface surface;
    vfloat weight, facing;
    vmask lit, open;
    bool flat; // all its hits are on the scene's first plane
    // So that no field is read of one packet a multiple of 4 KiB behind where another's was written just before.
    vfloat apart[16];
};

static inline struct vec background(vfloat weight, const struct known_model *model) {
    const double *b = model->background;
    return (struct vec){weight * v_splat((float)b[0]), weight * v_splat((float)b[1]),
                        weight * v_splat((float)b[2])};
}

// A packet of camera rays: what it has met so far. Where `only` is not −1, all of it is on that shape. Where nothing waits for
// it (needs_no_secondary()), hit.local is the normal in the world's axes, on one side or the other.
struct primary_hit {
    struct vec direction;
    vmask active;
    struct surface_hit hit;
    int only;
};

// Of hits on what is not repeated: their normals, as a sight has them.
KERNEL_SHARED void primary_normals(struct primary_hit *seen, const struct prepared *scene);

// Its colour, where nothing waits for it.
KERNEL_SHARED void shade_primary_hit(const struct primary_hit *seen, struct shading_packet *at,
                                     const struct tile_context *work);

// Sets the colours of packets whose hits are known; what waits for a shadow or a mirror ray is queued.
KERNEL_SHARED void shade_packets(struct shading_packet *stage, int count,
                                 const struct tile_context *work);

#endif
