// Bundles of secondary rays: see cones/tile_cones.h. The path is cut into intervals, one per lane. In each interval
// all rays are within `radius` of an axis.
#include "cones/distance_bounds.h"
#include "cones/tile_cones.h"
#include "core/local_rays.h"
#include "core/trace_context.h"
#include "march/march_step.h"

static vfloat most_lane(vmask active, vfloat a) {
    a = v_select(active, a, v_splat(-INFINITY));
    return v_max_of_lanes(a);
}

// Returns the value of the lane below, in each lane.
static vfloat lane_before(vfloat a) {
    float lanes[LANES + 1];
    v_store(a, lanes + 1);
    lanes[0] = lanes[1];
    return v_load(lanes);
}

// A bundle: rays from around a point, in about one direction. Every lane holds the same values.
struct ray_bundle {
    struct point from;
    struct vec axis;
    vfloat radius, spread, length;
};

// Returns the middle of the range of a over all lanes, from its maxima and those of −a, lane by lane.
static vfloat middle_of_lanes(vfloat most, vfloat most_negative) {
    vmask lanes = v_mask_all();
    return v_splat(0.5f) * (most_lane(lanes, most) - most_lane(lanes, most_negative));
}

struct vec_range {
    struct vec most, least; // least: the maxima of −v
};

static struct vec_range empty_range(void) {
    vfloat none = v_splat(-INFINITY);
    return (struct vec_range){{none, none, none}, {none, none, none}};
}

static void extend_range(struct vec_range *extent, vmask active, struct vec v) {
    struct vec none = empty_range().most, minus = vec_scale(v, v_splat(-1.0f));
    struct vec a = vec_select(active, v, none), b = vec_select(active, minus, none);
    extent->most = (struct vec){v_max(a.x, extent->most.x), v_max(a.y, extent->most.y),
                                v_max(a.z, extent->most.z)};
    extent->least = (struct vec){v_max(b.x, extent->least.x), v_max(b.y, extent->least.y),
                                 v_max(b.z, extent->least.z)};
}

static struct vec middle_of_range(const struct vec_range *extent) {
    return (struct vec){middle_of_lanes(extent->most.x, extent->least.x),
                        middle_of_lanes(extent->most.y, extent->least.y),
                        middle_of_lanes(extent->most.z, extent->least.z)};
}

// Returns the distance at which rays leave the bounds.
static vfloat exit_distance(struct point origin, struct vec direction, const struct model *model) {
    struct bounds_exit exit = bounds_exit_of(origin, direction, model);
    vfloat half = v_splat(-0.5f) * exit.linear;
    return half + v_sqrt(v_max(v_msub(half, half, exit.constant), v_splat(0.0f)));
}

static struct ray_bundle bundle_of(const struct ray_group *rays, const vfloat *length, int packets,
                                   const struct model *model) {
    struct vec_range places = empty_range(), directions = places;
    for (int k = 0; k < packets; k++) {
        if (!v_any(rays->active[k]))
            continue;
        extend_range(&places, rays->active[k], rays->origin[k].hi);
        extend_range(&directions, rays->active[k], rays->direction[k]);
    }
    vfloat zero = v_splat(0.0f), minus = v_splat(-1.0f);
    struct ray_bundle b = {.from = {middle_of_range(&places), {zero, zero, zero}}};
    struct vec axis = middle_of_range(&directions);
    vfloat size = vec_norm(axis);
    b.axis = vec_scale(axis, v_splat(1.0f) / v_max(size, v_splat(1e-3f)));
    vfloat off = zero, turn = zero, far = zero;
    for (int k = 0; k < packets; k++) {
        if (!v_any(rays->active[k]))
            continue;
        struct vec apart = vec_along(rays->origin[k].hi, b.from.hi, minus);
        struct vec turned = vec_along(rays->direction[k], b.axis, minus);
        vfloat path =
            length ? length[k] : exit_distance(rays->origin[k], rays->direction[k], model);
        off = v_select(rays->active[k], v_max(vec_dot(apart, apart), off), off);
        turn = v_select(rays->active[k], v_max(vec_dot(turned, turned), turn), turn);
        far = v_select(rays->active[k], v_max(path, far), far);
    }
    vmask lanes = v_mask_all();
    vfloat tiny = v_splat(0x1p-18f);
    b.radius = v_madd(vec_norm(b.from.hi), tiny, v_sqrt(most_lane(lanes, off)));
    b.spread = v_sqrt(most_lane(lanes, turn)) + tiny;
    b.spread = v_select(v_cmp_lt(size, v_splat(0.5f)), v_splat(2.0f), b.spread); // no axis
    b.length = most_lane(lanes, far) * v_splat(1.0f + 0x1p-10f);
    return b;
}

// Returns the ends of the intervals, as parts of the whole path. From the second on, each end is 1.5 times (16 lanes)
// or twice (8) as far as the one before it.
static vfloat interval_ends(void) {
#if LANES == 16
    static const float ends[LANES] = {0,          0.00342551f, 0.00513826f, 0.00770739f,
                                      0.0115611f, 0.0173416f,  0.0260125f,  0.0390187f,
                                      0.0585281f, 0.0877921f,  0.131688f,   0.197532f,
                                      0.296298f,  0.444447f,   0.666667f,   1};
#else
    static const float ends[LANES] = {0, 0x1p-6f, 0x1p-5f, 0x1p-4f, 0x1p-3f, 0x1p-2f, 0.5f, 1};
#endif
    return v_load(ends);
}

// The path in intervals. Lane i begins where lane i − 1 ends, and its rays stay within `radius` of the axis. Lane 0 is
// no interval.
struct ray_intervals {
    vfloat ends, length, radius;
};

static struct ray_intervals intervals_of(const struct ray_bundle *b) {
    vfloat ends = b->length * interval_ends();
    return (struct ray_intervals){
        ends, ends - lane_before(ends),
        v_madd(b->spread, ends, v_madd(ends, v_splat(0x1p-18f), b->radius))};
}

// Whether a ray may hit the shape in an interval. At u behind one end, the distance is at least d0 − u and at least d
// − (length − u).
static vmask may_be_hit(vfloat d, const struct ray_intervals *in, vfloat close) {
    return v_cmp_ge(in->radius + close, v_splat(0.5f) * (lane_before(d) + d - in->length));
}

// Whether the shape may be the nearest in an interval: three of the four pairs of its lower bound and the least upper
// bound.
static vmask may_be_nearest(vfloat d, vfloat least, const struct ray_intervals *in) {
    vfloat d0 = lane_before(d), least0 = lane_before(least), length = in->length;
    vfloat apart = v_max(d - length - least0, d0 - length - least);
    apart = v_max(apart, v_splat(0.5f) * ((d0 - least0) + (d - least)) - length);
    return v_cmp_ge(in->radius + in->radius, apart);
}

// Sets scratch->distance to lower bounds at the ends of the intervals. Returns the least upper bound of all shapes.
static vfloat bounds_at(vfloat ends, const struct ray_bundle *b, enum list_kind meant,
                        const struct prepared *scene, struct march_scratch *scratch) {
    vfloat least = v_splat(INFINITY);
    struct packet_rays packet = probe_rays(scratch, scene);
    set_local_origins(b->from, scene, &packet);
    set_local_directions(b->axis, scene, &packet);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct primitive *primitive = &scene->primitives[i];
        if (primitive->trust == BOUND_NONE)
            continue;
        vfloat d = lower_bound(&scratch->probe[i], ends, primitive);
        if (primitive->trust == BOUND_LIPSCHITZ)
            least = v_min(upper_bound(d, primitive), least);
        else if (meant == LIST_NEAREST) // bounds of the Mandelbulb's estimate
            d = v_max(d * v_splat(0.5f), d + v_splat(primitive->a - FAR_TANGENT));
        scratch->distance[i] = d;
    }
    return least;
}

static struct shape_list list_by_intervals(const struct ray_bundle *b, enum list_kind meant,
                                           const struct prepared *scene,
                                           struct march_scratch *scratch, int *shapes) {
    struct ray_intervals in = intervals_of(b);
    vfloat least = bounds_at(in.ends, b, meant, scene, scratch);
    // A ray that starts inside a shape is hit behind its origin, by at most its depth.
    float ends[LANES];
    v_store(least, ends);
    float depth = ends[0] < 0.0f ? -ends[0] : 0.0f;
    v_store(b->radius, ends);
    vfloat close = v_splat(near_distance(&scene->model.march) + depth + ends[0]);
    for (int i = 0; i < scene->model.shape_count; i++) {
        vmask here = v_mask_all();
        if (scene->primitives[i].trust != BOUND_NONE)
            here = meant == LIST_NEAREST ? may_be_nearest(scratch->distance[i], least, &in)
                                         : may_be_hit(scratch->distance[i], &in, close);
        scratch->wanted[i] = (v_mask_bits(here) & ~1u) != 0;
    }
    if (meant == LIST_HIT)
        return list_wanted_hits(scratch->wanted, scene, shapes);
    return list_wanted(scratch->wanted, scene, shapes);
}

void list_for_bundle(const struct ray_group *rays, const vfloat *length, enum list_kind meant,
                     struct trace_context *world, int *shapes) {
    const struct prepared *scene = world->scene;
    struct shape_list list = scene->all;
    if (list.count > 1) {
        struct ray_bundle b = bundle_of(rays, length, packets_in(world->group), &scene->model);
        list = list_by_intervals(&b, meant, scene, world->scratch, shapes);
    }
    for (int k = 0; k < packets_in(world->group); k++)
        world->group->packet[k].list = list;
}
