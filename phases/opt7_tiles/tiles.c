// Cones and bundles: see tiles.h. A cone's axis stands at t; its rays are within spread·t of it. All
// of them may go on by d(axis) − spread·t: the ball of radius d about the axis holds no surface. The
// bounds hold for what float makes of the distances: each is lowered by more than it errs.
#include "tiles.h"

enum { MOST_CONE_STEPS = 512 };

// A shape is met once the gap to it is below that part of the cone's radius.
static const float NEAR = 0.5f;

size_t own_size(int shapes) {
    return (size_t)shapes *
           (2 * sizeof(struct approach) + sizeof(real) + sizeof(mask) + 4 * sizeof(int));
}

struct own own_of(void *memory, int shapes) {
    size_t n = (size_t)shapes;
    struct own own = {.approach = memory};
    own.eye = own.approach + n;
    own.distance = (real *)(own.eye + n);
    own.kept = own.distance + n;
    own.lanes = (int *)(own.kept + n);
    own.tile = own.lanes + n;
    own.mirror = own.tile + n;
    own.shadow = own.mirror + n;
    return own;
}

// Nowhere on the way further from where the shape's own distance would say "hit" (see struct placed).
__attribute__((always_inline)) static inline real lower_bound(const struct approach *a, real t,
                                                              const struct placed *placed) {
    COUNT(lower_bound, call);
    real d;
    if (placed->trust == BALL) {
        COUNT(lower_bound, ball);
        struct vec p = vec_along(a->origin, a->direction, t);
        d = vec_norm(placed->repeated ? vec_wrapped(placed, p) : p) - set(placed->a);
    } else
        d = distance_to_shape(a, t, placed, set(0.0f));
    return neg_mul_add(absolute(d), set(0x1p-18f), d - set(placed->slack));
}

void march_cones(struct place eye, mask active, struct cones *cones, const struct prepared *scene,
                 struct own *own) {
    COUNT(march_cones, call);
    const struct limits *limits = &scene->model.march;
    int shapes = scene->model.shape_count;
    real zero = set(0.0f), inf = set(INFINITY), bounds = set((float)limits->bounds_radius);
    real from_centre = vec_dot(eye.hi, eye.hi);
    real linear = set(2.0f) * vec_dot(eye.hi, cones->axis);
    real furthest = (bounds + root(from_centre)) * set(1.0f + 0x1p-10f);
    real close = set((float)(limits->hit_distance + 4.0 * limits->normal_step));
    approach_directions(cones->axis, scene, scene->all, own->eye);
    // From outside of the bounds a ray's first step decides: nothing is known of it.
    mask known = both(active, less(from_centre, bounds * bounds * set(1.0f - 0x1p-18f)));
    mask met = not_in(known), done = not_in(known);
    for (int i = 0; i < shapes; i++)
        own->kept[i] = either(not_in(known), scene->placed[i].trust == NOTHING ? known : zero);
    for (int i = 0; i < shapes; i++)
        met = either(met, own->kept[i]);
    real t = zero, start = zero;
    for (int step = 0; step < MOST_CONE_STEPS && bits(done) != (1 << LANES) - 1; step++) {
        ACTIVE(LANES - count_of(done));
        COUNT(march_cones, step);
        real radius = mul_add(cones->spread, t, mul_add(t, set(0x1p-18f), close));
        real touch = mul_add(cones->spread * set(NEAR), t, radius);
        real least = inf, sunk = inf;
        mask touched = zero;
        for (int i = 0; i < shapes; i++) {
            const struct placed *placed = &scene->placed[i];
            if (placed->trust == NOTHING)
                continue;
            COUNT(march_cones, shape);
            real d = lower_bound(&own->eye[i], t, placed);
            mask here = but_not(done, less(d, touch));
            own->kept[i] = either(own->kept[i], here);
            touched = either(touched, here);
            least = least_of(choose(own->kept[i], inf, d), least);
            if (placed->trust == DISTANCE)
                sunk = least_of(choose(own->kept[i], d, inf), sunk);
        }
        mask first = but_not(met, touched);
        start = choose(first, t, start);
        met = either(met, touched);
        // At the camera: a ray that begins within a shape is hit behind it, wherever that is.
        if (step == 0 && bits(first)) {
            for (int i = 0; i < shapes; i++)
                own->kept[i] = either(own->kept[i], first);
            done = either(done, first);
        }
        mask hit = less(sunk + radius, zero); // each of its rays is, by now
        t = t + but_not(done, least - radius);
        real wide = mul_add(cones->spread, t, bounds * set(1.0f + 0x1p-16f));
        mask out = either(greater(mul_add(t, t + linear, from_centre), wide * wide),
                          not_less(t, furthest));
        done = either(done, either(hit, out));
        // A cone that has met nothing when it leaves has missed.
        start = choose(but_not(met, both(out, active)), inf, start);
        met = either(met, out);
    }
    mask late = not_in(done); // out of steps: all that was passed is known, and nothing behind
    start = choose(but_not(met, late), t, start);
    for (int i = 0; i < shapes; i++)
        own->lanes[i] = bits(either(own->kept[i], late));
    cones->start = most_of(neg_mul_add(start, set(0x1p-18f), start), zero);
}

struct list list_of_cone(int lane, const struct prepared *scene, struct own *own) {
    COUNT(list_of_cone, call);
    int count = 0;
    for (int i = 0; i < scene->model.shape_count; i++) {
        own->tile[count] = i;
        count += own->lanes[i] >> lane & 1;
    }
    return (struct list){count, own->tile};
}

static real most_lane(mask active, real a) {
    a = choose(active, a, set(-INFINITY));
    a = most_of(a, _mm256_permute2f128_ps(a, a, 1));
    a = most_of(a, _mm256_shuffle_ps(a, a, 0x4e));
    return most_of(a, _mm256_shuffle_ps(a, a, 0xb1));
}

static real middle(mask active, real a) {
    real most = most_lane(active, a);
    return set(0.5f) * (most - most_lane(active, set(-1.0f) * a));
}

static real before(real ends) { // of each lane that of the lane below
    return _mm256_permutevar8x32_ps(ends, _mm256_setr_epi32(0, 0, 1, 2, 3, 4, 5, 6));
}

// Rays from around a place into about one direction: in every lane the same.
struct bundle {
    struct place from;
    struct vec axis;
    real radius, spread, length;
};

static struct bundle bundle_of(struct place origin, struct vec direction, mask active,
                               real length) {
    COUNT(bundle_of, call);
    struct vec zero = {set(0.0f), set(0.0f), set(0.0f)};
    struct bundle b;
    b.from = (struct place){
        {middle(active, origin.hi.x), middle(active, origin.hi.y), middle(active, origin.hi.z)},
        zero};
    b.axis = (struct vec){middle(active, direction.x), middle(active, direction.y),
                          middle(active, direction.z)};
    real size = vec_norm(b.axis);
    b.axis = vec_scale(b.axis, set(1.0f) / most_of(size, set(1e-3f)));
    struct vec off = vec_along(origin.hi, b.from.hi, set(-1.0f));
    struct vec turn = vec_along(direction, b.axis, set(-1.0f));
    real reach = vec_norm(b.from.hi);
    b.radius = mul_add(reach, set(0x1p-18f), root(most_lane(active, vec_dot(off, off))));
    b.spread = root(most_lane(active, vec_dot(turn, turn))) + set(0x1p-18f);
    b.spread = choose(less(size, set(0.5f)), set(2.0f), b.spread); // no axis
    b.length = most_lane(active, length) * set(1.0f + 0x1p-10f);
    return b;
}

// Of each interval: whether the shape can be the least there, or be hit.
static mask matters(real d, real ends, real least, const struct bundle *b, float close,
                    enum meant meant) {
    COUNT(matters, call);
    real way = ends - before(ends), d0 = before(d);
    real radius = mul_add(b->spread, ends, mul_add(ends, set(0x1p-18f), b->radius));
    if (meant == HIT)
        return not_less(radius + set(close), set(0.5f) * (d0 + d - way));
    // Between the ends a distance stays within both ends' bounds, u and way − u away: three of the
    // four pairs of the shape's lower and the least's upper bound.
    real least0 = before(least);
    real apart = most_of(d - way - least0, d0 - way - least);
    apart = most_of(apart, set(0.5f) * ((d0 - least0) + (d - least)) - way);
    return not_less(radius + radius, apart);
}

struct meeting meet(struct place origin, struct vec direction, mask active, real length,
                    enum meant meant, const struct world *world, int *shapes) {
    COUNT(meet, call);
    const struct prepared *scene = world->scene;
    struct bundle b = bundle_of(origin, direction, active, length);
    real ends = b.length * _mm256_setr_ps(0, 0x1p-6f, 0x1p-5f, 0x1p-4f, 0x1p-3f, 0x1p-2f, 0.5f, 1);
    real least = set(INFINITY);
    struct approach *approach = world->approach;
    approach_origins(b.from, scene, scene->all, approach);
    approach_directions(b.axis, scene, scene->all, approach);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct placed *placed = &scene->placed[i];
        if (placed->trust == NOTHING)
            continue;
        COUNT(meet, shape);
        real d = lower_bound(&approach[i], ends, placed);
        if (placed->trust == DISTANCE) // and not above it by more than it was lowered
            least =
                least_of(mul_add(absolute(d), set(0x1p-16f), d + set(2.0f * placed->slack)), least);
        else if (meant == UNION) // of the Mandelbulb's estimate
            d = d * set(0.5f);
        world->own->distance[i] = d;
    }
    const struct limits *limits = &scene->model.march;
    float close = (float)(limits->hit_distance + 4.0 * limits->normal_step);
    int count = 0;
    __m256i places = _mm256_setzero_si256();
    for (int i = 0; i < scene->model.shape_count; i++) {
        mask here = not_in(set(0.0f));
        if (scene->placed[i].trust != NOTHING)
            here = matters(world->own->distance[i], ends, least, &b, close, meant);
        if (!(bits(here) & ~1)) // lane 0 is no interval
            continue;
        if (meant == HIT) // a ray must not step over it from an interval before
            here = not_in(set(0.0f));
        shapes[count] = i;
        __m256i place = _mm256_set1_epi32((int)(1u << (count < 31 ? count : 31)));
        places = _mm256_or_si256(places, _mm256_and_si256(_mm256_castps_si256(here), place));
        count++;
    }
    return (struct meeting){{count, shapes}, places, set(1.0f) / most_of(b.length, set(1e-30f))};
}
