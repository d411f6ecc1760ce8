// A packet of shadow rays and its march, and the functions that shading and the files of shadow/ call.
#pragma once

#include "simd/simd.h"
#include "types/known_scene.h"

struct shading_packet;
struct tile_context;

// A packet of shadow rays relative to one shape.
struct shadow_candidate {
    struct vec origin,
        direction; // in the shape's frame; linear plane: x is the height and its slope
    // power: a sphere on which some of the rays start. Its distance comes from |p|² − radius² = constant +
    // t·(t + slope).
    vfloat constant, slope;
    bool power;
    vfloat from;       // before this t another shape is nearer
    vfloat wake_bound; // while t + the nearest distance is below it, another shape is nearer
};

_Static_assert(offsetof(struct shadow_candidate, origin) == 0 &&
                   offsetof(struct shadow_candidate, direction) == 3 * sizeof(vfloat),
               "bulb_shadows.c moves origin and direction as six vectors");

// A packet of shadow rays, and what list_candidates() or bvh_first_entry() finds out about it.
struct shadow_rays {
    vmask active;
    struct vec point, local, to_light; // local: the point in the frame of its shape
    vfloat facing, shape;              // facing: cosine between normal and to_light
    vfloat end;                        // no term beyond this t is below 1
    vfloat leap_limit;    // rays from a plane: before this t nothing is nearer than the plane
    vmask on_plane;       // rays that start on a plane
    bool from_planes;     // all rays start on planes
    vfloat first, cosine; // t of the first entry into a solid, and its cosine; cosine 0: not usable
    vfloat sharp;         // see entry_cosine()
    vmask meets_one,
        meets_many; // rays from a plane: some shape can darken them; not one convex solid alone
};

// The march of a packet of shadow rays. Lanes that move take MARCH_REALS vectors with them, from t on.
struct shadow_march {
    struct shadow_candidate *candidates; // one per shape
    const struct shape_set *listed;      // the shapes that can be the nearest
    vmask done;
    vfloat t, step_began, previous,
        end; // step_began: where the step to t began, at distance `previous` from the shapes
    vfloat square, divisor;  // the least term is √(square/divisor): one root at the end
    vfloat linear, constant; // t·(t + linear) + constant > 0: outside the bounds
    vmask sole_solid;        // rays that one convex solid alone can darken
};

enum { MARCH_REALS = 8 };
_Static_assert(offsetof(struct shadow_march, constant) ==
                   offsetof(struct shadow_march, t) + (MARCH_REALS - 1) * sizeof(vfloat),
               "MARCH_REALS vectors in a row");

// With fewer max_steps every step is taken: no leap, and no ray is dark without a march.
enum { LEAP_MIN_MAX_STEPS = 256 };

// Soft shadows (shadow/shadow_cull.c): returns the rays of `active` that need no march. No other shape brings
// a term below 1, and the ray's own shape can do so in the first two terms only (self_shadow()). Tests
// scratch->occluders.
KERNEL_SHARED vmask trivially_lit(const struct vec *point, const struct vec *local,
                                  const struct vec *to_light, vfloat facing, vfloat shape,
                                  vmask active, const struct tile_context *work);

// As trivially_lit(), with a cone query for each ray in place of scratch->occluders.
vmask bvh_trivially_lit(struct vec point, struct vec local, struct vec to_light, vfloat facing,
                        vfloat shape, vmask active, const struct tile_context *work);

// Returns the shadow of such rays that graze their own shape s: the lesser of the first two terms, or 1.
KERNEL_SHARED vfloat self_shadow(const struct primitive *s, struct vec local, struct vec to_light,
                                 vfloat facing, const struct prepared *scene);

// Hard shadows: returns the rays that reach the light, at `distance`. Tests scratch->occluders.
KERNEL_SHARED vmask reaches_light(struct vec point, struct vec local, struct vec to_light,
                                  vfloat shape, vfloat distance, vmask active,
                                  const struct tile_context *work);

// Sets scratch->occluders: the shapes that can darken a hit of the group (shadow/occluders.c).
KERNEL_SHARED void list_occluders(const struct shading_packet *stage, int count,
                                  const struct tile_context *work);

// Sets the candidate of plane i, and updates end, leap limit and first entry of the rays.
KERNEL_INLINE void candidate_plane(const struct primitive *s, int i, struct shadow_rays *r,
                                   const struct tile_context *work,
                                   struct shadow_candidate *candidate);

// Updates the first entry of the rays `met` by their entry into solid i. Rays that start on it are left out.
KERNEL_INLINE void first_entry(const struct primitive *s, int i, struct shadow_rays *r, vmask met);

KERNEL_INLINE void set_candidate_ray(const struct shadow_rays *r, int i,
                                     struct shadow_candidate *candidate,
                                     const struct tile_context *work);

// Sets the candidates of a packet, lists the shapes that can be the nearest before the rays' end, and finds
// end, leap limit and first entry of the rays.
KERNEL_SHARED void list_candidates(struct shadow_rays *r, struct shadow_candidate *candidates,
                                   struct shape_set *listed, const struct tile_context *work);

// Sets the rays' end and their first entry into a solid of scratch->entry_list.
void bvh_first_entry(struct shadow_rays *r, struct shadow_candidate *candidates,
                     const struct tile_context *work);

// Starts a march: sets the first t, and ends rays that are dark by proof (PROOFS.md, 4.). With a BVH nothing
// is listed.
KERNEL_SHARED void begin_march(struct shadow_rays *r, struct shadow_candidate *candidates,
                               struct shape_set *listed, const struct tile_context *work,
                               struct shadow_march *m);

// Marches all queued shadow rays, adds their light to their pixels, and empties the queue.
KERNEL_SHARED void cast_shadows(const struct tile_context *work);

// The same for scenes with a BVH, with a Mandelbulb, and for all others.
void cast_batches(const struct tile_context *work);
KERNEL_SHARED void cast_streams(const struct tile_context *work);
KERNEL_SHARED void cast_packets(const struct tile_context *work);
