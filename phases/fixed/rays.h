// Rays through pixels and the spheres that they hit: −b − √d of each, the nearest ahead, as the article has it.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
#ifndef FIXED_RAYS_H
#define FIXED_RAYS_H

#include "counting/flops.h"
#include "number.h"
#include "world.h"

struct rays {
    struct vec from, along;
    mask on;
};

struct hit {
    num t, shape; // shape: −1, none
    mask found;
};

static struct vec vec_set(const one a[3]) {
    return (struct vec){set(a[0]), set(a[1]), set(a[2])};
}

static struct vec vec_minus(struct vec a, struct vec b) {
    return (struct vec){minus(a.x, b.x), minus(a.y, b.y), minus(a.z, b.z)};
}

// a + b·s
static struct vec vec_along(struct vec a, struct vec b, num s, const struct format *f) {
    return (struct vec){plus(a.x, times(b.x, s, f)), plus(a.y, times(b.y, s, f)),
                        plus(a.z, times(b.z, s, f))};
}

static struct vec vec_choose(mask m, struct vec a, struct vec b) {
    return (struct vec){choose(m, a.x, b.x), choose(m, a.y, b.y), choose(m, a.z, b.z)};
}

static struct vec look_up_vec(one *const table[3], num at) {
    return (struct vec){look_up(table[0], at), look_up(table[1], at), look_up(table[2], at)};
}

// Of rays through the middle of pixels, given as 2·column + 1 − width and height − 1 − 2·row.
static struct vec get_direction(num across, num up, const struct world *w) {
    COUNT(get_direction, call);
    const struct format *f = &w->format;
    const num per = set(w->per_height);
    num x = shifted(product(across, per), w->finer), y = shifted(product(up, per), w->finer);
    struct per nothing;
    struct vec d = vec_set(w->forward), r = vec_set(w->right), u = vec_set(w->up);
    d.x = plus(d.x, shifted(plus(product(r.x, x), product(u.x, y)), f->bits));
    d.y = plus(d.y, shifted(plus(product(r.y, x), product(u.y, y)), f->bits));
    d.z = plus(d.z, shifted(plus(product(r.z, x), product(u.z, y)), f->bits));
    return normalised(d, f, &nothing);
}

// A sphere is hit at −b − √d, if that is ahead and nearer than what was.
static void hit_sphere(int i, num b, num d, struct hit *hit, const struct format *f) {
    COUNT(hit_sphere, call);
    mask real = positive(d);
    if (!any(real))
        return;
    COUNT(hit_sphere, met);
    num t = minus(minus(set(0), b), root(d, f));
    mask nearer = both(both(real, positive(t)), less(t, hit->t));
    hit->t = choose(nearer, t, hit->t);
    hit->shape = choose(nearer, set(i), hit->shape);
}

static struct hit nothing_hit(void) {
    return (struct hit){.t = set(MOST), .shape = set(-1)};
}

// Of camera rays: what does not depend on their direction was worked out for the frame.
static struct hit first_hit(struct vec along, const struct world *w, const int *list, int count) {
    COUNT(first_hit, call);
    const struct format *f = &w->format;
    struct hit hit = nothing_hit();
    for (int k = 0; k < count; k++) {
        COUNT(first_hit, sphere);
        int i = list[k];
        struct vec from = {set(w->eye[0][i]), set(w->eye[1][i]), set(w->eye[2][i])};
        num b = sum3(from, along, f);
        hit_sphere(i, b, plus(times(b, b, f), set(w->rest[i])), &hit, f);
    }
    hit.found = less(set(-1), hit.shape);
    return hit;
}

static struct hit next_hit(const struct rays *rays, const struct world *w) {
    COUNT(next_hit, call);
    const struct format *f = &w->format;
    struct hit hit = nothing_hit();
    for (int i = 0; i < w->count; i++) {
        COUNT(next_hit, sphere);
        struct vec from = {minus(rays->from.x, set(w->centre[0][i])),
                           minus(rays->from.y, set(w->centre[1][i])),
                           minus(rays->from.z, set(w->centre[2][i]))};
        num b = sum3(from, rays->along, f);
        num d = plus(minus(times(b, b, f), sum3(from, from, f)), set(w->radius_sq[i]));
        hit_sphere(i, b, choose(rays->on, d, set(0)), &hit, f);
    }
    hit.found = both(rays->on, less(set(-1), hit.shape));
    return hit;
}

// Which of the rays meet a sphere before `far`.
static mask blocked(struct rays rays, num far, const struct world *w) {
    COUNT(blocked, call);
    const struct format *f = &w->format;
    mask dark = but_not(rays.on, rays.on);
    for (int i = 0; i < w->count; i++) {
        ACTIVE(count_of(rays.on));
        COUNT(blocked, sphere);
        struct vec from = {minus(rays.from.x, set(w->centre[0][i])),
                           minus(rays.from.y, set(w->centre[1][i])),
                           minus(rays.from.z, set(w->centre[2][i]))};
        num b = sum3(from, rays.along, f);
        num d = plus(minus(times(b, b, f), sum3(from, from, f)), set(w->radius_sq[i]));
        mask ahead = both(both(rays.on, positive(d)), less(b, set(0)));
        if (!any(ahead))
            continue;
        COUNT(blocked, ahead);
        num t = minus(minus(set(0), b), root(d, f));
        mask now = both(both(ahead, positive(t)), less(t, far));
        dark = either(now, dark);
        rays.on = but_not(now, rays.on);
        if (!any(rays.on))
            break;
    }
    return dark;
}

#endif
