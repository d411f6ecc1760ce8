// Bundles of secondary rays: see tiles.h. All of them are within `radius` of an axis, in each of some intervals of
// the way; an interval is a lane.
#include "bounds.h"

// From afar the Mandelbulb's estimate is r·ln(r)/3, which is above its tangent at e²: r less this.
#define TANGENT 2.48f

static real most_lane(mask active, real a) {
    COUNT(most_lane, call);
    a = choose(active, a, set(-INFINITY));
#if LANES == 16
    return set(_mm512_reduce_max_ps(a));
#else
    a = most_of(a, _mm256_permute2f128_ps(a, a, 1));
    a = most_of(a, _mm256_shuffle_ps(a, a, 0x4e));
    return most_of(a, _mm256_shuffle_ps(a, a, 0xb1));
#endif
}

static real below_it(real a) { // of each lane that of the lane below
    float lanes[LANES + 1];
    unload(a, lanes + 1);
    lanes[0] = lanes[1];
    return load(lanes);
}

// Rays from around a place into about one direction: in every lane the same.
struct bundle {
    struct place from;
    struct vec axis;
    real radius, spread, length;
};

// The middle of what the group's lanes hold; `most` and the most of −a, lane by lane.
static real middle(real most, real most_negative) {
    mask lanes = all_lanes();
    return set(0.5f) * (most_lane(lanes, most) - most_lane(lanes, most_negative));
}

struct extent {
    struct vec most, least; // least: of −v
};

static struct extent no_extent(void) {
    real none = set(-INFINITY);
    return (struct extent){{none, none, none}, {none, none, none}};
}

static void extend(struct extent *extent, mask active, struct vec v) {
    struct vec none = no_extent().most, minus = vec_scale(v, set(-1.0f));
    struct vec a = vec_choose(active, v, none), b = vec_choose(active, minus, none);
    extent->most = (struct vec){most_of(a.x, extent->most.x), most_of(a.y, extent->most.y),
                                most_of(a.z, extent->most.z)};
    extent->least = (struct vec){most_of(b.x, extent->least.x), most_of(b.y, extent->least.y),
                                 most_of(b.z, extent->least.z)};
}

static struct vec middle_of(const struct extent *extent) {
    return (struct vec){middle(extent->most.x, extent->least.x),
                        middle(extent->most.y, extent->least.y),
                        middle(extent->most.z, extent->least.z)};
}

// Where rays leave the bounds.
static real way_out(struct place origin, struct vec direction, const struct model *model) {
    COUNT(way_out, call);
    struct exit exit = leaving(origin, direction, model);
    real half = set(-0.5f) * exit.linear;
    return half + root(most_of(mul_sub(half, half, exit.constant), set(0.0f)));
}

static struct bundle bundle_of(const struct rays *rays, const real *length, int packets,
                               const struct model *model) {
    COUNT(bundle_of, call);
    struct extent places = no_extent(), directions = places;
    for (int k = 0; k < packets; k++) {
        if (!any(rays->active[k]))
            continue;
        COUNT(bundle_of, packet);
        extend(&places, rays->active[k], rays->origin[k].hi);
        extend(&directions, rays->active[k], rays->direction[k]);
    }
    real zero = set(0.0f), minus = set(-1.0f);
    struct bundle b = {.from = {middle_of(&places), {zero, zero, zero}}};
    struct vec axis = middle_of(&directions);
    real size = vec_norm(axis);
    b.axis = vec_scale(axis, set(1.0f) / most_of(size, set(1e-3f)));
    real off = zero, turn = zero, far = zero;
    for (int k = 0; k < packets; k++) {
        if (!any(rays->active[k]))
            continue;
        struct vec apart = vec_along(rays->origin[k].hi, b.from.hi, minus);
        struct vec turned = vec_along(rays->direction[k], b.axis, minus);
        real way = length ? length[k] : way_out(rays->origin[k], rays->direction[k], model);
        off = choose(rays->active[k], most_of(vec_dot(apart, apart), off), off);
        turn = choose(rays->active[k], most_of(vec_dot(turned, turned), turn), turn);
        far = choose(rays->active[k], most_of(way, far), far);
    }
    mask lanes = all_lanes();
    real tiny = set(0x1p-18f);
    b.radius = mul_add(vec_norm(b.from.hi), tiny, root(most_lane(lanes, off)));
    b.spread = root(most_lane(lanes, turn)) + tiny;
    b.spread = choose(less(size, set(0.5f)), set(2.0f), b.spread); // no axis
    b.length = most_lane(lanes, far) * set(1.0f + 0x1p-10f);
    return b;
}

// The ends of the intervals, of the whole way: each half as long again as the one before it, or twice.
static real ends_of_way(void) {
#if LANES == 16
    static const float ends[LANES] = {0,          0.00342551f, 0.00513826f, 0.00770739f,
                                      0.0115611f, 0.0173416f,  0.0260125f,  0.0390187f,
                                      0.0585281f, 0.0877921f,  0.131688f,   0.197532f,
                                      0.296298f,  0.444447f,   0.666667f,   1};
#else
    static const float ends[LANES] = {0, 0x1p-6f, 0x1p-5f, 0x1p-4f, 0x1p-3f, 0x1p-2f, 0.5f, 1};
#endif
    return load(ends);
}

// The way cut in intervals: lane i ends at ends, begins where lane i − 1 ends, and its rays stay within `radius`
// of the axis. Lane 0 is no interval.
struct intervals {
    real ends, length, radius;
};

static struct intervals intervals_of(const struct bundle *b) {
    COUNT(intervals_of, call);
    real ends = b->length * ends_of_way();
    return (struct intervals){ends, ends - below_it(ends),
                              mul_add(b->spread, ends, mul_add(ends, set(0x1p-18f), b->radius))};
}

// Between the ends, u and length − u away, a distance is within the bounds from both.
static mask can_be_hit(real d, const struct intervals *in, real close) {
    COUNT(can_be_hit, call);
    return not_less(in->radius + close, set(0.5f) * (below_it(d) + d - in->length));
}

// Three of the four pairs of the shape's lower and the least's upper bound.
static mask can_be_least(real d, real least, const struct intervals *in) {
    COUNT(can_be_least, call);
    real d0 = below_it(d), least0 = below_it(least), length = in->length;
    real apart = most_of(d - length - least0, d0 - length - least);
    apart = most_of(apart, set(0.5f) * ((d0 - least0) + (d - least)) - length);
    return not_less(in->radius + in->radius, apart);
}

// Into own->distance; the least of them from above.
static real bounds_at(real ends, const struct bundle *b, enum meant meant,
                      const struct prepared *scene, struct own *own) {
    COUNT(bounds_at, call);
    real least = set(INFINITY);
    struct beam beam = eye_of(own, scene);
    approach_origins(b->from, scene, &beam);
    approach_directions(b->axis, scene, &beam);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct placed *placed = &scene->placed[i];
        if (placed->trust == NOTHING)
            continue;
        real d = lower_bound(&own->eye[i], ends, placed);
        if (placed->trust == DISTANCE) {
            COUNT(bounds_at, distance);
            least = least_of(upper_bound(d, placed), least);
        } else if (meant == UNION) { // of the Mandelbulb's estimate
            COUNT(bounds_at, estimate);
            d = most_of(d * set(0.5f), d + set(placed->a - TANGENT));
        }
        own->distance[i] = d;
    }
    return least;
}

static struct list listed(const struct bundle *b, enum meant meant, const struct prepared *scene,
                          struct own *own, int *shapes) {
    struct intervals in = intervals_of(b);
    real least = bounds_at(in.ends, b, meant, scene, own);
    // A ray from within a shape is hit behind its origin: as far as it is deep.
    float ends[LANES];
    unload(least, ends);
    float depth = ends[0] < 0.0f ? -ends[0] : 0.0f;
    unload(b->radius, ends);
    real close = set(close_of(&scene->model.march) + depth + ends[0]);
    for (int i = 0; i < scene->model.shape_count; i++) {
        mask here = all_lanes();
        if (scene->placed[i].trust != NOTHING)
            here = meant == UNION ? can_be_least(own->distance[i], least, &in)
                                  : can_be_hit(own->distance[i], &in, close);
        own->wanted[i] = (bits(here) & ~1u) != 0;
    }
    if (meant == HIT)
        return hit_list(own->wanted, scene, shapes);
    return list_of(own->wanted, scene, shapes);
}

void meet(const struct rays *rays, const real *length, enum meant meant, struct world *world,
          int *shapes) {
    ACTIVE(LANES);
    COUNT(meet, call);
    const struct prepared *scene = world->scene;
    struct list list = scene->all;
    if (list.count > 1) {
        struct bundle b = bundle_of(rays, length, world->group.size, &scene->model);
        list = listed(&b, meant, scene, world->own, shapes);
    }
    for (int k = 0; k < world->group.size; k++)
        world->group.beam[k].list = list;
}
