// Batches of shadow rays, in scenes with a BVH: up to eight packets of rays from one solid or from planes
// march together and share an active set of the shapes near them.
#pragma once

#include "shadow/shadow_rays.h"
#include "types/numerics.h"
#include "types/sdf.h"
#include "types/tile_context.h"

enum { BATCH_PACKETS = 8, BATCH_RAYS = BATCH_PACKETS * LANES };

// A packet of a batch. Its rays drift apart, so only the rays near the active set march; the others wait.
struct batch_packet {
    struct shadow_march march;
    struct shadow_rays rays;
    struct vec start;          // of the rays, relative to batch.origin
    struct vec local_to;       // rays from a solid: to_light in its frame
    vfloat until, query_slope; // the last cone query: its blocker ends at `until`; its slope
    vfloat ray;                // index in the queue
    vmask waits;
    struct vec at; // the points at t, relative to batch.origin
    vfloat
        least;  // distance to the nearest shape there; −∞ for idle rays, so that no shape is nearer
    int recent; // index in the active set of the shape that was nearest last
    int solid;  // on which all rays start, −1: planes
};

// Vectors that move with a ray to another packet: runs that begin at march.t, at rays.point and at `start`.
enum { RAY_REALS = 11, BATCH_REALS = 9, BATCH_ROWS = MARCH_REALS + RAY_REALS + BATCH_REALS };

_Static_assert(offsetof(struct shadow_rays, shape) ==
                       offsetof(struct shadow_rays, point) + (RAY_REALS - 1) * sizeof(vfloat) &&
                   offsetof(struct batch_packet, ray) ==
                       offsetof(struct batch_packet, start) + (BATCH_REALS - 1) * sizeof(vfloat),
               "one behind the other");

// A shape of an active set.
struct candidate {
    const struct primitive *shape;
    float centre[3],
        bound; // centre: relative to batch.origin. bound: of its bounding sphere, infinite for a plane
};

// A lower bound of the distances of a packet's rays to a shape, for later t: intercept + slope·t.
struct falling_bound {
    vfloat intercept, slope;
};

// All shapes within `within` of a segment, from `start` on, `length` along a ray. room: rays this near to the
// segment can take a step.
struct active_set {
    struct vec start, along;
    float length, within, room;
    int count, solids; // solids come first, planes behind
    int *list;
    struct candidate *shapes;
    struct falling_bound *below; // BATCH_PACKETS per shape
};

struct shadow_batch {
    struct batch_packet packet[BATCH_PACKETS];
    int count, moving; // packets; the first `moving` of them have rays that march
    float origin[3];   // coordinates are relative to this point, so that floats keep their digits
    struct active_set set;
};

static inline struct vec offset_from_segment(const struct active_set *v, struct vec at) {
    struct vec to = vec_sub(at, v->start);
    vfloat along = v_min(v_max(vec_dot(to, v->along), v_splat(0.0f)), v_splat(v->length));
    return (struct vec){v_nmadd(along, v->along.x, to.x), v_nmadd(along, v->along.y, to.y),
                        v_nmadd(along, v->along.z, to.z)};
}

static inline vfloat distance_from_segment(const struct active_set *v, struct vec at) {
    return vec_norm(offset_from_segment(v, at));
}

// Makes the active set ahead of one of the rays in `last` of packet w, whose nearest shape is at h or less.
// Sets which rays wait.
void set_active_set(struct shadow_batch *batch, const struct batch_packet *w, vfloat h, vmask last,
                    const struct tile_context *work);

// Sets the falling bounds of all shapes and packets from bounding spheres.
void set_falling_bounds(struct shadow_batch *batch);

// Sets `at` and `least` of the packets that have rays to march.
void active_nearest(struct shadow_batch *batch);

// Returns the heights of the rays over a plane at t. self: rays that start on it.
static inline vfloat plane_height(const struct primitive *s, vmask self,
                                  const struct batch_packet *w) {
    return v_madd(w->march.t, vec_dot(vec_set(s->normal), w->rays.to_light),
                  v_zero_where(self, height_over(s, w->rays.point)));
}

static inline vmask is_idle(const struct batch_packet *w) {
    return v_or(w->march.done, w->waits);
}

// Steps between two cone queries in an active set.
enum { CHECK_INTERVAL = 6 };

// Sorts the queued rays into scratch->order[0]: rays from one solid follow one another in the BVH's order,
// and rays from planes come last, in Morton order.
void sort_shadow_rays(struct worker_scratch *scratch, const struct prepared *scene);

// Returns where the batch ends that begins at place `first` of the sorted queue.
int batch_end(const struct worker_scratch *scratch, int first);

// One cone query for the first packets of a batch. A ray ends if its cone meets no shape further on.
void query_ahead(struct shadow_batch *batch, int packets, const struct tile_context *work);

// Writes the light that reaches the rays in `done` to the queue.
void store_lit(const struct batch_packet *w, vmask done, struct worker_scratch *scratch);

// Moves the rays into as few packets as hold them: first the rays that march, behind them the rays that wait.
// Rays that have ended are stored and left out. Returns whether any ray has moved.
bool compact_packets(struct shadow_batch *batch, struct worker_scratch *scratch);
