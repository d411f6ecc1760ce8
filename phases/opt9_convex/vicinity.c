// See beam.h. Which shapes are about a stretch of the way ahead of the rays, and which of them is the nearest.
#include "beam.h"
#include "seek.h"

// Radius of a vicinity at least, in radii of the nodes above the shapes, and beside the distance that the nearest shape is
// no further than. NOTES.md has what others cost.
#define VICINITY 0.4f
#define WIDER 1.2f
// How much of that distance a ray leaves to the vicinity's edge, at least: it has room for a step.
#define MARGIN 0.4f
// How far ahead of the ray behind all others it starts, as a share of what leaves that one a step: all of them go on.
#define AHEAD 0.6f
// How long its stretch is, in the same radii: rays that go the same way stay in it for several steps.
#define LENGTH 1.0f

static inline mask within_reach(struct vec centre, real radius, const void *with) {
    COUNT(within_reach, call);
    const struct vicinity *v = with;
    struct vec off = vec_off(v, centre);
    real r = set(v->within) + radius;
    return less(vec_dot(off, off), r * r);
}

static float picked(mask one, real x) {
    return least_lane(choose(one, x, set(INFINITY)));
}

static void find_close_by(struct beam *beam, float slack, const struct prepared *scene) {
    COUNT(find_close_by, call);
    COUNT(find_close_by, scalar);
    struct vicinity *v = &beam->near;
    const float *place = beam->place;
    struct vicinity around = *v;
    around.start = (struct vec){v->start.x + set(place[0]), v->start.y + set(place[1]),
                                v->start.z + set(place[2])};
    around.within = v->within * (1 + 1e-4f) + slack;
    v->solids = list_those(&scene->tree, within_reach, &around, v->list);
    v->count = and_planes(scene, v->list, v->solids);
    for (int k = 0; k < v->count; k++) {
        COUNT(find_close_by, shape);
        const struct placed *s = &scene->placed[v->list[k]];
        v->shapes[k].shape = s;
        v->shapes[k].bound = s->way == LINEAR ? INFINITY : s->bound;
        for (int i = 0; i < 3; i++)
            v->shapes[k].place[i] = s->position[i] - place[i];
    }
}

void vicinity_about(struct beam *beam, const struct walk *w, real h, mask last,
                    const struct convex *work) {
    ACTIVE(count_of(last));
    COUNT(vicinity_about, call);
    COUNT(vicinity_about, scalar);
    const struct prepared *scene = work->scene;
    struct vicinity *v = &beam->near;
    struct vec p = vec_along(w->from, w->rays.to_light, w->march.t), l = w->rays.to_light;
    unsigned lane = bits(last) & (0u - bits(last)); // one of them
    mask one = lanes_of(lane);
    float near = picked(one, h), left = picked(one, w->march.end - w->march.t);
    v->within = fmaxf(WIDER * near, VICINITY * scene->tree.spacing);
    float slack = 1e-6f * (float)scene->model.march.bounds_radius;
    float on = fmaxf(AHEAD * (v->within - near) - 2 * slack, 0.0f); // it must not wait itself
    struct vec ahead = vec_along(p, l, set(on));
    v->start = (struct vec){set(picked(one, ahead.x)), set(picked(one, ahead.y)),
                            set(picked(one, ahead.z))};
    v->along = (struct vec){set(picked(one, l.x)), set(picked(one, l.y)), set(picked(one, l.z))};
    v->length = fmaxf(fminf(LENGTH * scene->tree.spacing, left - on), 0.0f);
    v->room = v->within - MARGIN * near;
    find_close_by(beam, slack, scene);
    for (int i = 0; i < beam->count; i++) {
        struct walk *each = &beam->walk[i];
        ACTIVE(LANES - count_of(each->march.done));
        COUNT(vicinity_about, packet);
        struct vec at = vec_along(each->from, each->rays.to_light, each->march.t);
        each->waits = not_less(distance_off(v, at), set(v->room));
    }
}

// To the solid's bounding sphere by an approximate root, to 10 bits and less by that much.
static inline real surely_off(const struct close_by *c, struct vec at) {
    COUNT(surely_off, call);
    struct vec to = {at.x - set(c->place[0]), at.y - set(c->place[1]), at.z - set(c->place[2])};
    real square = most_of(vec_dot(to, to), set(1e-30f));
    return square * root_guess(square) * set(1 - 0x1p-10f) - set(c->bound);
}

// What was h at t, or a bound of it, wakes where h + t is no more than the nearest shape's distance + t, see nearest().
static inline real wakes_at(real h, real t) {
    return (h + t) * set(1.0f - 0x1p-18f);
}

static inline real beginning(const struct walk *w) {
    return choose(stands_still(w), set(-INFINITY), set(INFINITY));
}

void vicinity_wakes(struct beam *beam) {
    COUNT(vicinity_wakes, call);
    struct vicinity *v = &beam->near;
    for (int i = 0; i < beam->moving; i++) {
        struct walk *w = &beam->walk[i];
        ACTIVE(LANES - count_of(stands_still(w)));
        COUNT(vicinity_wakes, packet);
        struct vec at = vec_along(w->from, w->rays.to_light, w->march.t);
        real nearest = beginning(w), t = w->march.t, *wakes = v->wakes + i;
        int recent = 0, solids = v->solids;
        const struct close_by *shapes = v->shapes;
        for (int k = 0; k < solids; k++, wakes += BEAM) {
            COUNT(vicinity_wakes, shape);
            real far = surely_off(&shapes[k], at);
            *wakes = wakes_at(far, t);
            recent = any(less(far, nearest)) ? k : recent;
            nearest = least_of(far, nearest);
        }
        w->recent = recent;
        for (int k = solids; k < v->count; k++, wakes += BEAM)
            *wakes = set(-INFINITY);
    }
}

// Of those rays that are from the solid, as exactly as its own frame allows: near to it a sphere's distance in float is
// noise in the third digit, that of its power is not.
static real own_distance(struct vec p, const struct walk *w, mask own, const struct placed *s) {
    COUNT(own_distance, call);
    real t = w->march.t;
    p = vec_choose(own, vec_along(w->rays.local, w->local_to, t), p);
    real h = distance_at(p, s, no_lane());
    if (s->type != SHAPE_SPHERE)
        return h;
    COUNT(own_distance, sphere);
    real slope = set(2.0f) * vec_dot(w->rays.local, w->local_to), power = t * (t + slope);
    real from = power / (root(most_of(power + set(s->bound_sq), set(0.0f))) + set(s->a));
    return choose(own, from, h);
}

static inline real distance_to(const struct close_by *c, const struct walk *w) {
    COUNT(distance_to, call);
    const struct placed *s = c->shape;
    mask own = both(w->rays.active, same_shape(w->rays.shape, (int)s->index));
    if (s->way == LINEAR) {
        COUNT(distance_to, plane);
        real height = drop(own, height_over(s, w->rays.point));
        return mul_add(w->march.t, vec_dot(vec_set(s->normal), w->rays.to_light), height);
    }
    COUNT(distance_to, solid);
    struct vec p = {w->at.x - set(c->place[0]), w->at.y - set(c->place[1]),
                    w->at.z - set(c->place[2])};
    p = turned(s, p);
    return any(own) ? own_distance(p, w, own, s) : distance_at(p, s, no_lane());
}

// c: shape k of the vicinity; when it wakes for these rays goes to *wakes.
static inline void ask_about(const struct close_by *c, int k, struct walk *w, real *wakes) {
    COUNT(ask_about, call);
    real h = distance_to(c, w);
    *wakes = wakes_at(h, w->march.t);
    w->recent = any(less(h, w->least)) ? k : w->recent;
    w->least = least_of(h, w->least);
}

// Whether the bounding sphere alone says that no ray is as near to the shape as to what is known: its distance to 10 bits, less
// that much, is then when it wakes.
static inline bool too_far(const struct close_by *c, const struct walk *w, real *wakes) {
    COUNT(too_far, call);
    real t = w->march.t, then = wakes_at(surely_off(c, w->at), t);
    if (any(not_less(w->least + t, then))) // so it is of planes
        return false;
    *wakes = then;
    return true;
}

enum { AT_ONCE = 64 }; // shapes; of each a byte, of each packet a bit
_Static_assert((int)BEAM <= 8, "a bit for each");

// Sets packet i's bit of those shapes from `first` on, AT_ONCE at most, that may be nearer to one of its rays than what is.
static inline void wake(const struct vicinity *v, int first, int i, const struct walk *w,
                        unsigned awake[AT_ONCE / 4]) {
    COUNT(wake, call);
    int count = lesser(v->count - first, AT_ONCE);
    real until = w->least + w->march.t;
    const real *wakes = &v->wakes[first * BEAM + i];
    for (int k = 0; k < count;
         k += 4, wakes += 4 * BEAM) { // what is read behind the last is of no shape
        COUNT(wake, four);
        unsigned which =
            any_of_four(not_less(until, wakes[0]), not_less(until, wakes[BEAM]),
                        not_less(until, wakes[2 * BEAM]), not_less(until, wakes[3 * BEAM]));
        awake[k / 4] |= (which * 0x204081u & 0x01010101u) << i; // bit k of `which`: bit 8·k
    }
}

// The shape that was the nearest is asked first: what sleeps beside that is told for all at once, for a branch on each
// one's distance waits for its root. And each is asked for all packets at once, for the same reason.
void vicinity_nearest(struct beam *beam) {
    const struct vicinity *v = &beam->near;
    const struct close_by *shapes = v->shapes; // what is stored may not change it
    struct walk *walk = beam->walk;
    real *wakes = v->wakes;
    unsigned moving = 0;
    for (int i = 0; i < beam->moving; i++) {
        struct walk *w = &beam->walk[i];
        if (all(stands_still(w)))
            continue;
        ACTIVE(LANES - count_of(stands_still(w)));
        COUNT(vicinity_nearest, packet);
        moving |= 1u << i;
        w->at = vec_along(w->from, w->rays.to_light, w->march.t);
        w->least = beginning(w);
        if (v->count > 0)
            ask_about(&shapes[w->recent], w->recent, w, &wakes[w->recent * BEAM + i]);
    }
    for (int first = 0; first < v->count; first += AT_ONCE) {
        unsigned awake[AT_ONCE / 4] = {0};
        for (unsigned rest = moving; rest; rest &= rest - 1) {
            int i = __builtin_ctz(rest), asked = beam->walk[i].recent - first;
            ACTIVE(LANES - count_of(stands_still(&beam->walk[i])));
            wake(v, first, i, &beam->walk[i], awake);
            if (asked >= 0 && asked < AT_ONCE)
                awake[asked / 4] &= ~(1u << (8 * (asked % 4) + i));
        }
        int count = lesser(v->count - first, AT_ONCE);
        for (int k = 0; k < count; k++) {
            const struct close_by *c = &shapes[first + k];
            real *row = &wakes[(first + k) * BEAM];
            for (unsigned rest = ((const unsigned char *)awake)[k]; rest; rest &= rest - 1) {
                int i = __builtin_ctz(rest);
                ACTIVE(LANES - count_of(stands_still(&walk[i])));
                if (!too_far(c, &walk[i], &row[i]))
                    ask_about(c, first + k, &walk[i], &row[i]);
            }
        }
    }
}
