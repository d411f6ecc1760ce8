// Cones and bundles: see tiles.h. A cone's axis stands at t; its rays are within spread·t of it. All of them may go
// on by d(axis) − spread·t, for the ball of radius d about the axis holds no surface. What float makes of a
// distance is taken off it before it is believed.
#include "tiles.h"

enum { MOST_CONE_STEPS = 512 };

// A cone meets a shape once the gap to it is below this part of the cone's radius.
#define GAP 0.5f

// From afar the Mandelbulb's estimate is r·ln(r)/3, which is above its tangent at e²: r less this.
#define TANGENT 2.48f

static size_t places(int shapes) { // so many that whole numbers behind masks are aligned
    return ((size_t)shapes + 1) / 2 * 2;
}

size_t own_size(int shapes) {
    return places(shapes) * ((GROUP + 1) * (sizeof(struct approach) + sizeof(real)) +
                             GROUP * sizeof(real) + sizeof(mask) + 6 * sizeof(int) + sizeof(bool));
}

struct own own_of(void *memory, int shapes) {
    size_t n = places(shapes);
    struct own own = {.wake = memory};
    own.approach = (struct approach *)(own.wake + GROUP * n);
    own.eye_wake = (real *)(own.approach + GROUP * n);
    own.eye = (struct approach *)(own.eye_wake + GROUP * n);
    own.distance = (real *)(own.eye + n);
    own.met = (mask *)(own.distance + n);
    own.tile = (int *)(own.met + n);
    own.mirror = own.tile + 2 * n;
    own.shadow = own.mirror + 2 * n;
    own.wanted = (bool *)(own.shadow + 2 * n);
    return own;
}

static struct beam eye_of(struct own *own, const struct prepared *scene) {
    return (struct beam){own->eye, scene->all, own->eye_wake, set(0.0f)};
}

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

// From a place on the way to the nearest from where the shape's own distance may say "hit".
__attribute__((always_inline)) static inline real lower_bound(const struct approach *a, real t,
                                                              const struct placed *placed) {
    COUNT(lower_bound, call);
    real d;
    if (placed->trust == BALL) {
        COUNT(lower_bound, ball);
        struct vec p = vec_along(a->origin, a->direction, t);
        d = vec_norm(placed->repeated ? vec_wrapped(placed, p) : p) - set(placed->a);
    } else
        d = distance_to_shape(a, t, placed, placed->repeated, placed->way, placed->type,
                              all_lanes());
    return neg_mul_add(absolute(d), set(0x1p-18f), d - set(placed->error));
}

// What the distance itself is not above: by as much as was taken off it.
static inline real upper_bound(real lower, const struct placed *placed) {
    COUNT(upper_bound, call);
    return mul_add(absolute(lower), set(0x1p-16f), mul_add(set(placed->error), set(2.0f), lower));
}

static float close_of(const struct limits *limits) {
    return (float)(limits->hit_distance + 4.0 * limits->normal_step);
}

// One step of the cones: what they touch where they are, how far to the nearest of what they have not met
// (`least`), how deep they are in what they have.
struct around {
    mask touched;
    real least, depth;
};

static struct around look_around(real t, real radius, real touch, mask live,
                                 const struct prepared *scene, struct own *own) {
    struct around found = {no_lane(), set(INFINITY), set(INFINITY)};
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct placed *placed = &scene->placed[i];
        if (placed->trust == NOTHING)
            continue;
        COUNT(march_cones, shape);
        real d = lower_bound(&own->eye[i], t, placed);
        mask here = less_in(live, d, touch);
        mask met = own->met[i] = either(own->met[i], here);
        found.touched = either(found.touched, here);
        found.least = least_of(choose(met, set(INFINITY), d), found.least);
        if (placed->trust != DISTANCE)
            continue;
        COUNT(march_cones, depth);
        real depth = upper_bound(d, placed) + radius;
        found.depth = least_of(choose(met, depth, set(INFINITY)), found.depth);
    }
    return found;
}

static void meet_all(mask lanes, const struct prepared *scene, struct own *own) {
    for (int i = 0; i < scene->model.shape_count; i++)
        own->met[i] = either(own->met[i], lanes);
}

void march_cones(struct place eye, mask active, struct cones *cones, const struct prepared *scene,
                 struct own *own) {
    ACTIVE(count_of(active));
    COUNT(march_cones, call);
    const struct limits *limits = &scene->model.march;
    real zero = set(0.0f), bounds = set((float)limits->bounds_radius);
    real from_centre = vec_dot(eye.hi, eye.hi);
    real linear = set(2.0f) * vec_dot(eye.hi, cones->axis);
    real furthest = (bounds + root(from_centre)) * set(1.0f + 0x1p-10f);
    real close = set(close_of(limits)), t = zero;
    real gap = cones->spread * set(GAP), outer = bounds * set(1.0f + 0x1p-16f);
    struct beam beam = eye_of(own, scene);
    approach_origins(eye, scene, &beam);
    approach_directions(cones->axis, scene, &beam);
    // From outside of the bounds a ray's first step decides whether it goes on: nothing is known of it.
    mask live = both(active, less(from_centre, bounds * bounds * set(1.0f - 0x1p-18f)));
    mask met = but_not(live, active);
    cones->start = zero;
    for (int i = 0; i < scene->model.shape_count; i++)
        own->met[i] = scene->placed[i].trust == NOTHING ? active : but_not(live, active);
    for (int i = 0; i < scene->model.shape_count; i++)
        met = either(met, own->met[i]);
    for (int step = 0; step < MOST_CONE_STEPS && any(live); step++) {
        ACTIVE(count_of(live));
        COUNT(march_cones, step);
        real radius = mul_add(cones->spread, t, mul_add(t, set(0x1p-18f), close));
        real touch = mul_add(gap, t, radius);
        struct around around = look_around(t, radius, touch, live, scene, own);
        mask first = but_not(met, around.touched);
        cones->start = choose(first, t, cones->start);
        met = either(met, around.touched);
        // A ray from within a shape is hit behind it, near to whatever is there.
        if (step == 0 && any(first)) {
            meet_all(first, scene, own);
            live = but_not(first, live);
        }
        // Each of its rays has been hit by now, or is out of the bounds.
        mask hit = less(around.depth, zero);
        t = add_where(live, t, around.least - radius);
        real wide = mul_add(cones->spread, t, outer);
        mask out = either(greater(mul_add(t, t + linear, from_centre), wide * wide),
                          not_less(t, furthest));
        cones->start = choose(both(live, but_not(met, out)), set(INFINITY), cones->start);
        live = but_not(either(hit, out), live);
    }
    if (any(live)) { // out of steps: known as far as they are
        cones->start = choose(but_not(met, live), t, cones->start);
        meet_all(live, scene, own);
    }
    cones->start =
        choose(less(cones->start, set(INFINITY)),
               most_of(neg_mul_add(cones->start, set(0x1p-18f), cones->start), zero), cones->start);
}

static struct list list_of(const bool *wanted, const struct prepared *scene, int *shapes) {
    const struct list *all = &scene->all;
    int count = 0, same = 0, steady = 0, *order = shapes + all->count;
    for (int n = 0; n < all->count; n++) {
        shapes[count] = n;
        count += wanted[n];
        order[same] = all->order[n];
        same += wanted[all->order[n]];
        steady += n < all->steady && wanted[all->order[n]];
    }
    return (struct list){count, steady, shapes, order};
}

struct list list_of_cone(int lane, const struct prepared *scene, struct own *own) {
    COUNT(list_of_cone, call);
    for (int i = 0; i < scene->model.shape_count; i++)
        own->wanted[i] = bits(own->met[i]) >> lane & 1;
    return list_of(own->wanted, scene, own->tile);
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

static struct bundle bundle_of(const struct rays *rays, const real *length,
                               const struct model *model) {
    COUNT(bundle_of, call);
    struct extent places = no_extent(), directions = places;
    for (int k = 0; k < GROUP; k++) {
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
    for (int k = 0; k < GROUP; k++) {
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
    return list_of(own->wanted, scene, shapes);
}

void meet(const struct rays *rays, const real *length, enum meant meant, struct world *world,
          int *shapes) {
    ACTIVE(LANES);
    COUNT(meet, call);
    const struct prepared *scene = world->scene;
    struct list list = scene->all;
    if (list.count > 1) {
        struct bundle b = bundle_of(rays, length, &scene->model);
        list = listed(&b, meant, scene, world->own, shapes);
    }
    world->group.meant = meant;
    for (int k = 0; k < GROUP; k++)
        world->group.beam[k].list = list;
}
