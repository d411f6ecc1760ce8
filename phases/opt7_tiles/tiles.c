// Cones: see tiles.h. A cone's axis stands at t; its rays are within spread·t of it. All of them may go
// on by d(axis) − spread·t, for the ball of radius d about the axis holds no surface. What float makes of a
// distance is taken off it before it is believed.
#include "bounds.h"

enum { MOST_CONE_STEPS = 512 };

// A cone meets a shape once the gap to it is below this part of the cone's radius.
#define GAP 0.5f

static size_t places(int shapes) { // so many that whole numbers behind masks are aligned
    return ((size_t)shapes + 1) / 2 * 2;
}

static int most_packets(const struct model *model) {
    for (int i = 0; i < model->shape_count; i++)
        if (model->shapes[i].type == SHAPE_MANDELBULB)
            return GROUP;
    return FEW;
}

size_t own_size(const struct model *model) {
    return places(model->shape_count) *
           ((size_t)(most_packets(model) + 2) * (sizeof(struct approach) + sizeof(real)) +
            LEVELS * sizeof(mask) + (6 + 2 * LEVELS) * sizeof(int) + sizeof(bool));
}

struct own own_of(void *memory, const struct model *model) {
    size_t n = places(model->shape_count);
    struct own own = {.packets = most_packets(model), .wake = memory};
    size_t packets = (size_t)own.packets;
    own.approach = (struct approach *)(own.wake + packets * n);
    own.eye_wake = (real *)(own.approach + packets * n);
    own.eye = (struct approach *)(own.eye_wake + n);
    own.distance = (real *)(own.eye + n);
    own.axis = (struct approach *)(own.distance + n);
    own.met[0] = (mask *)(own.axis + n);
    for (int level = 1; level < LEVELS; level++)
        own.met[level] = own.met[0] + level * n;
    own.offered[0] = (int *)(own.met[0] + LEVELS * n);
    for (int level = 1; level < LEVELS; level++)
        own.offered[level] = own.offered[0] + 2 * level * n;
    own.tile = own.offered[0] + 2 * LEVELS * n;
    own.mirror = own.tile + 2 * n;
    own.shadow = own.mirror + 2 * n;
    own.wanted = (bool *)(own.shadow + 2 * n);
    return own;
}

// One step of the cones: what they touch where they are, how far to the nearest of what they have not met
// (`least`), how deep they are in what they have.
struct around {
    mask touched;
    real least, depth;
};

static struct around look_around(real t, real radius, real touch, mask live, struct list offered,
                                 mask *all_met, const struct prepared *scene,
                                 const struct own *own) {
    struct around found = {no_lane(), set(INFINITY), set(INFINITY)};
    for (int n = 0; n < offered.count; n++) {
        int i = offered.shape[n];
        const struct placed *placed = &scene->placed[i];
        if (placed->trust == NOTHING)
            continue;
        COUNT(march_cones, shape);
        real d = lower_bound(&own->axis[i], t, placed);
        mask here = less_in(live, d, touch);
        mask met = all_met[i] = either(all_met[i], here);
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

static void meet_all(mask lanes, struct list offered, mask *met) {
    for (int n = 0; n < offered.count; n++)
        met[offered.shape[n]] = either(met[offered.shape[n]], lanes);
}

static struct beam axes_of(struct own *own, struct list list) {
    return (struct beam){own->axis, list, own->eye_wake, 1, set(0.0f)};
}

void place_cones(struct place eye, const struct prepared *scene, struct own *own) {
    struct beam beam = axes_of(own, scene->all);
    approach_origins(eye, scene, &beam);
}

void march_cones(struct place eye, mask active, int level, struct list offered, struct cones *cones,
                 const struct prepared *scene, struct own *own) {
    ACTIVE(count_of(active));
    COUNT(march_cones, call);
    const struct limits *limits = &scene->model.march;
    real zero = set(0.0f), bounds = set((float)limits->bounds_radius);
    real from_centre = vec_dot(eye.hi, eye.hi);
    real linear = set(2.0f) * vec_dot(eye.hi, cones->axis);
    real furthest = (bounds + root(from_centre)) * set(1.0f + 0x1p-10f);
    real close = set(close_of(limits)), t = cones->start;
    real gap = cones->spread * set(GAP), outer = bounds * set(1.0f + 0x1p-16f);
    struct beam beam = axes_of(own, offered);
    approach_directions(cones->axis, scene, &beam);
    // From outside of the bounds a ray's first step decides whether it goes on: nothing is known of it.
    mask live = both(active, less(from_centre, bounds * bounds * set(1.0f - 0x1p-18f)));
    mask met = but_not(live, active), *each = own->met[level], at_camera = not_less(zero, t);
    for (int i = 0; i < scene->model.shape_count; i++)
        each[i] = no_lane();
    for (int n = 0; n < offered.count; n++) {
        int i = offered.shape[n];
        each[i] = scene->placed[i].trust == NOTHING ? active : but_not(live, active);
        met = either(met, each[i]);
    }
    for (int step = 0; step < MOST_CONE_STEPS && any(live); step++) {
        ACTIVE(count_of(live));
        COUNT(march_cones, step);
        real radius = mul_add(cones->spread, t, mul_add(t, set(0x1p-18f), close));
        real touch = mul_add(gap, t, radius);
        struct around around = look_around(t, radius, touch, live, offered, each, scene, own);
        mask first = but_not(met, around.touched);
        cones->start = choose(first, t, cones->start);
        met = either(met, around.touched);
        // A ray from within a shape is hit behind it, near to whatever is there.
        if (step == 0 && any(both(first, at_camera))) {
            meet_all(both(first, at_camera), offered, each);
            live = but_not(both(first, at_camera), live);
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
        meet_all(live, offered, each);
    }
    cones->start =
        choose(less(cones->start, set(INFINITY)),
               most_of(neg_mul_add(cones->start, set(0x1p-18f), cones->start), zero), cones->start);
}

struct list list_of(const bool *wanted, const struct prepared *scene, int *shapes) {
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

struct list hit_list(const bool *wanted, const struct prepared *scene, int *shapes) {
    for (int i = 0; i < scene->model.shape_count; i++)
        if (wanted[i] && scene->placed[i].trust == BALL)
            return scene->all;
    return list_of(wanted, scene, shapes);
}

struct list list_below(unsigned some, int level, const struct prepared *scene, struct own *own) {
    for (int i = 0; i < scene->model.shape_count; i++)
        own->wanted[i] = (bits(own->met[level][i]) & some) != 0;
    return list_of(own->wanted, scene, own->offered[level]);
}

struct list list_of_cone(int lane, const struct prepared *scene, struct own *own, float *start) {
    COUNT(list_of_cone, call);
    for (int i = 0; i < scene->model.shape_count; i++) {
        own->wanted[i] = bits(own->met[0][i]) >> lane & 1;
        if (own->wanted[i] && scene->placed[i].trust == BALL)
            *start = 0.0f;
    }
    return hit_list(own->wanted, scene, own->tile);
}
