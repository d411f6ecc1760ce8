// A packet of shadow rays, its march, and what the files of shadow/ call of each other.
#ifndef OPT9_SHADOW_RAYS_H
#define OPT9_SHADOW_RAYS_H

#include "core/known_scene.h"
#include "simd/vec.h"

struct shading_packet;
struct tile_context;

// What a shape is to a packet of shadow rays.
struct shadow_candidate {
    struct vec origin, direction; // in its frame; EVAL_LINEAR: x is height and slope
    vfloat constant, slope;       // of a sphere that some of the rays are from (power):
    bool power;                   // |p|² − radius² = constant + t·(t + slope)
    vfloat from;                  // before that it is further than any other
    vfloat wake_bound;            // where t + the nearest distance is less, so is that one
};

_Static_assert(offsetof(struct shadow_candidate, origin) == 0 &&
                   offsetof(struct shadow_candidate, direction) == 3 * sizeof(vfloat),
               "one behind the other");

// A packet of shadow rays in work.
struct shadow_rays {
    vmask active;
    struct vec point, local, to_light;
    vfloat facing, shape;
    vfloat end;        // behind it no term comes below 1
    vfloat leap_limit; // before it nothing is nearer than the plane that the ray is from
    vmask on_plane;
    bool from_planes;     // all are from one
    vfloat first, cosine; // the first entry into a solid, of those that can be met; 0: not told
    vfloat sharp;         // see entry_cosine()
    vmask meets_one,
        meets_many; // of rays from a plane: one shape can be met; not one convex one alone
};

// One packet's march.
struct shadow_march {
    struct shadow_candidate *candidates; // one per shape
    const struct shape_set *listed;      // the shapes that can be the nearest
    vmask done;
    vfloat t, from, previous, end; // lanes that move take MARCH_REALS from here on with them
    vfloat square, divisor;        // least² = square/divisor; no root or quotient until the end
    vfloat linear, constant;       // t·(t + linear) + constant > 0: out of the bounds
    vmask sole_solid;              // one convex solid alone can bring a term below 1
};

enum { MARCH_REALS = 8 };
_Static_assert(offsetof(struct shadow_march, constant) ==
                   offsetof(struct shadow_march, t) + (MARCH_REALS - 1) * sizeof(vfloat),
               "one behind the other");

enum { LEAP_MIN_MAX_STEPS = 256 }; // with a cap below, every step is taken: none is leapt over

// Soft shadow rays on which no shape but their own can bring a term of the estimator below 1; and their own
// neither, but for the first two, since it bulges.
KERNEL_SHARED vmask trivially_lit(const struct vec *point, const struct vec *local,
                                  const struct vec *to_light, vfloat facing, vfloat shape,
                                  vmask active, const struct tile_context *work);

// The shadow on these: the least of those two terms.
KERNEL_SHARED vfloat self_shadow(const struct primitive *s, struct vec local, struct vec to_light,
                                 vfloat facing, const struct prepared *scene);

// Hard shadows: which rays reach the light.
KERNEL_SHARED vmask reaches_light(struct vec point, struct vec local, struct vec to_light,
                                  vfloat shape, vfloat distance, vmask active,
                                  const struct tile_context *work);

KERNEL_SHARED void list_occluders(const struct shading_packet *stage, int count,
                                  const struct tile_context *work);

KERNEL_INLINE void candidate_plane(const struct primitive *s, int i, struct shadow_rays *r,
                                   const struct tile_context *work,
                                   struct shadow_candidate *candidate);

// Where the rays `met` enter a solid that they are not from, and at what slant, if it is the first.
KERNEL_INLINE void first_entry(const struct primitive *s, int i, struct shadow_rays *r, vmask met);

// A shape's own view of the rays.
KERNEL_INLINE void set_candidate_ray(const struct shadow_rays *r, int i,
                                     struct shadow_candidate *candidate,
                                     const struct tile_context *work);

// The shapes that can be the nearest somewhere before the rays' end, with their own view of the rays.
KERNEL_SHARED void list_candidates(struct shadow_rays *r, struct shadow_candidate *candidates,
                                   struct shape_set *listed, const struct tile_context *work);

// Where a march begins, and whether it is told dark at once. Of a crowd no listed are listed.
KERNEL_SHARED void begin_march(struct shadow_rays *r, struct shadow_candidate *candidates,
                               struct shape_set *listed, const struct tile_context *work,
                               struct shadow_march *m);

// Marches all shadow rays that wait, and adds their light.
KERNEL_SHARED void cast_shadows(const struct tile_context *work);

// March all shadow rays that wait and add their light: of a crowd, where there is a Mandelbulb, of any other scene.
void cast_batches(const struct tile_context *work);
KERNEL_SHARED void cast_streams(const struct tile_context *work);
KERNEL_SHARED void cast_packets(const struct tile_context *work);

#endif
