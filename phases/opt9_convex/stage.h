// A packet of rays on its way to a colour.
#ifndef OPT9_STAGE_H
#define OPT9_STAGE_H

#include "convex.h"
#include "simd/point.h"

struct found {
    vmask found;
    vfloat t, shape;
    struct vec local; // in the shape's frame; not for planes
};

struct surface {
    struct vec normal, color;
    vfloat share, shininess, shine_from;
};

struct ray {
    struct vec origin, direction;
    vfloat weight, pixel, bounce, leaves; // leaves: the shape it is from, −1: none
    vmask active;
    struct vec
        local; // where repeated shapes are: the point it is from, in the frame of what it leaves
};

// A group of them takes each step together: each packet's steps wait
// for each other, those of different packets do not.
struct stage {
    struct ray ray;
    struct found hit;
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
// it (is_plain()), hit.local is the normal in the world's axes, on one side or the other.
struct sight {
    struct vec direction;
    vmask active;
    struct found hit;
    int only;
};

// Of hits on what is not repeated: their normals, as a sight has them.
SHARED void normals_seen(struct sight *seen, const struct prepared *scene);
// Its colour, where nothing waits for it.
SHARED void color_seen(const struct sight *seen, struct stage *at, const struct convex *work);
// Sets the colours of packets whose hits are known; what waits for a shadow or a mirror ray is queued.
SHARED void color_all(struct stage *stage, int count, const struct convex *work);

// Rays through a Mandelbulb's bounding sphere that wait for march_bulb(); returns how many there are now. o, d:
// in its frame; slot: where the first lane's answer is to be.
SHARED int gather_bulb(int count, const struct placed *s, struct vec_double o, struct vec_double d,
                       const struct ray *ray, vfloat end, int slot, const struct prepared *scene,
                       struct desk *desk);
// The answers: what the packet meets there, if before what it has met so far.
SHARED void take_bulb(struct stage *at, int slot, const struct desk *desk);
SHARED void clear_met(struct desk *desk, int slots);
// All of it for a group of mirror rays.
SHARED void meet_bulbs(struct stage *stage, int packets, const struct convex *work);

#endif
