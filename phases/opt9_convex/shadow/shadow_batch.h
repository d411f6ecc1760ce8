// Shadow rays of a crowd that are marched together: a few packets of them, neighbours by their order, share what
// is known of the shapes near them.
#ifndef OPT9_SHADOW_BATCH_H
#define OPT9_SHADOW_BATCH_H

#include "core/numerics.h"
#include "core/sdf.h"
#include "core/tile_context.h"
#include "shadow/shadow_rays.h"

enum { BATCH_PACKETS = 8, BATCH_RAYS = BATCH_PACKETS * LANES };

// A packet of them. The rays come apart, so only those in the vicinity are marched; the others wait.
struct batch_packet {
    struct shadow_march march;
    struct shadow_rays rays;
    struct vec from; // where they start, from the batch's place
    struct vec
        local_to; // to the light, in the frame of the solid that they are from, once they set out
    vfloat until, asked; // where what is in the way ends, of the cones of slope `asked`
    vfloat ray;          // which of the queue
    vmask waits;
    struct vec at; // where they are, from the batch's place
    vfloat
        least; // the nearest shape's distance there; −∞ of those that stand still: nothing is nearer
    int recent; // which of the vicinity was the nearest to one of them
    int solid;  // that they all are from, −1: from planes
};

// What moves with a ray to another packet: so many reals from march.t, from rays.point and from `from` on.
enum { RAY_REALS = 11, BATCH_REALS = 9, BATCH_ROWS = MARCH_REALS + RAY_REALS + BATCH_REALS };

_Static_assert(offsetof(struct shadow_rays, shape) ==
                       offsetof(struct shadow_rays, point) + (RAY_REALS - 1) * sizeof(vfloat) &&
                   offsetof(struct batch_packet, ray) ==
                       offsetof(struct batch_packet, from) + (BATCH_REALS - 1) * sizeof(vfloat),
               "one behind the other");

// A shape of a vicinity.
struct candidate {
    const struct primitive *shape;
    float centre[3], bound; // from the batch's; of the sphere about it, ∞: a plane
};

// What the distances of a packet's rays to a shape are never below further on: rest + slope·t.
struct falling_bound {
    vfloat intercept, slope;
};

// All shapes that are within `within` of a stretch of the way: from `start` on, `length` along a ray.
struct active_set {
    struct vec start, along;
    float length, within, room; // room: for rays to take a step in it
    int count, solids;          // those are the first ones, planes the others
    int *list;
    struct candidate *shapes;
    struct falling_bound *below; // of each shape and packet
};

struct shadow_batch {
    struct batch_packet packet[BATCH_PACKETS];
    int count, moving; // packets; the first ones have rays that do not wait
    float origin[3];   // what is near is told from here, so that float has digits for it
    struct active_set set;
};

// From the vicinity's stretch to a place.
static inline struct vec offset_from_stretch(const struct active_set *v, struct vec at) {
    struct vec to = {at.x - v->start.x, at.y - v->start.y, at.z - v->start.z};
    vfloat along = v_min(v_max(vec_dot(to, v->along), v_splat(0.0f)), v_splat(v->length));
    return (struct vec){v_nmadd(along, v->along.x, to.x), v_nmadd(along, v->along.y, to.y),
                        v_nmadd(along, v->along.z, to.z)};
}

static inline vfloat distance_from_stretch(const struct active_set *v, struct vec at) {
    COUNT(distance_from_stretch, call);
    return vec_norm(offset_from_stretch(v, at));
}

// Ahead of one of the lanes in `last` of a packet, where the nearest shape is no further than h.
// Sets which of the rays wait.
void set_active_set(struct shadow_batch *batch, const struct batch_packet *w, vfloat h, vmask last,
                    const struct tile_context *work);

// What the rays can know of each shape from afar.
void set_falling_bounds(struct shadow_batch *batch);

// Sets `at` and `least` of the packets with rays that do not stand still.
void active_nearest(struct shadow_batch *batch);

// How high the rays of a packet are over a plane, where they are now; those in `own` are from it.
static inline vfloat plane_height(const struct primitive *s, vmask self,
                                  const struct batch_packet *w) {
    COUNT(plane_height, call);
    return v_madd(w->march.t, vec_dot(vec_set(s->normal), w->rays.to_light),
                  v_zero_where(self, height_over(s, w->rays.point)));
}

static inline float most_lane(vfloat x) {
    return -least_lane(v_splat(0.0f) - x);
}

static inline vmask is_idle(const struct batch_packet *w) {
    return v_or(w->march.done, w->waits);
}

// Steps between two cone queries, in an active set or away from the rays' own solid.
enum { CHECK_INTERVAL = 6 };

// Sorts the queued rays into scratch->order[0]: rays from one solid follow one another in the BVH's order, and rays from
// planes come last, in Morton order.
void sort_shadow_rays(struct worker_scratch *scratch, const struct prepared *scene);

// Returns where the batch ends that begins at place `first` of the sorted queue.
int batch_end(const struct worker_scratch *scratch, int first);

// One cone query for the first packets of a batch. A ray ends if its cone meets no shape further on.
void query_ahead(struct shadow_batch *batch, int packets, const struct tile_context *work);

// Writes the light that reaches the rays in `done` to the queue.
void store_lit(const struct batch_packet *w, vmask done, struct worker_scratch *scratch);

// Moves the rays into as few packets as hold them: first the rays that march, behind them the rays that wait. Rays that have
// ended are stored and left out. Returns whether any ray has moved.
bool compact_packets(struct shadow_batch *batch, struct worker_scratch *scratch);

// Marches the rays from a solid, as long as no other shape can be nearer than that solid.
void leave_own_solid(struct shadow_batch *batch, vfloat strength, vfloat hit,
                     const struct tile_context *work);

#endif
