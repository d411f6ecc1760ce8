// Camera rays, and the spheres that rays hit: t = −b − √(b² − c), the nearest one ahead, as in the article.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
// A header, as all of it must be inlined into each build of tile.c.
#pragma once

#include "number/number.h"
#include "scene_tables.h"

// A ray in each lane; directions are of unit length. Lanes that are not active hold any numbers.
struct packet {
    struct vec origin, direction;
    vmask active;
};

struct hit {
    vnum t, shape; // shape: −1, none
    vmask found;
};

static struct vec vec_splat(const scalar a[3]) {
    return (struct vec){v_splat(a[0]), v_splat(a[1]), v_splat(a[2])};
}

// a + b·s
static struct vec vec_madd(struct vec a, struct vec b, vnum s, const struct format *f) {
    return (struct vec){v_add(a.x, v_mul(b.x, s, f)), v_add(a.y, v_mul(b.y, s, f)),
                        v_add(a.z, v_mul(b.z, s, f))};
}

static struct vec vec_chosen(vmask m, struct vec a, struct vec b) {
    return (struct vec){v_select(m, a.x, b.x), v_select(m, a.y, b.y), v_select(m, a.z, b.z)};
}

static struct vec vec_gather(scalar *const table[3], vnum at) {
    return (struct vec){v_lookup(table[0], at), v_lookup(table[1], at), v_lookup(table[2], at)};
}

// Returns the unit directions of rays through the middle of pixels.
// across = 2·column + 1 − width, up = height − 1 − 2·row: offsets from the picture's middle in half pixels.
static struct vec camera_direction(vnum across, vnum up, const struct scene_tables *scene) {
    const struct format *f = &scene->format;
    const vnum half = v_splat(scene->half_pixel);
    vnum x = v_sra(v_mul_wide(across, half), scene->half_pixel_shift);
    vnum y = v_sra(v_mul_wide(up, half), scene->half_pixel_shift);
    struct reciprocal unused;
    struct vec d = vec_splat(scene->forward), r = vec_splat(scene->right), u = vec_splat(scene->up);
    d.x = v_add(d.x, v_sra(v_add(v_mul_wide(r.x, x), v_mul_wide(u.x, y)), f->bits));
    d.y = v_add(d.y, v_sra(v_add(v_mul_wide(r.y, x), v_mul_wide(u.y, y)), f->bits));
    d.z = v_add(d.z, v_sra(v_add(v_mul_wide(r.z, x), v_mul_wide(u.z, y)), f->bits));
    return normalize(d, f, &unused);
}

// Takes the hit at −b − √discriminant of sphere i into `hit`, where it is ahead and the nearest so far.
static void take_nearer(int i, vnum b, vnum discriminant, struct hit *hit, const struct format *f) {
    vmask real = v_positive(discriminant);
    if (!v_any(real))
        return;
    vnum t = v_sub(v_sub(v_splat(0), b), v_root(discriminant, f));
    vmask nearer = v_and(v_and(real, v_positive(t)), v_cmp_lt(t, hit->t));
    hit->t = v_select(nearer, t, hit->t);
    hit->shape = v_select(nearer, v_splat(i), hit->shape);
}

static struct hit no_hit(void) {
    return (struct hit){.t = v_splat(LARGEST_FACTOR), .shape = v_splat(-1)};
}

// Returns the first hits of camera rays among `count` candidate spheres.
// Cheaper than intersect(): eye and minus_c are the frame's, as all rays start at the camera.
static struct hit intersect_camera_rays(struct vec direction, const struct scene_tables *scene,
                                        const int *candidates, int count) {
    const struct format *f = &scene->format;
    struct hit hit = no_hit();
    for (int k = 0; k < count; k++) {
        int i = candidates[k];
        struct vec eye = {v_splat(scene->eye[0][i]), v_splat(scene->eye[1][i]),
                          v_splat(scene->eye[2][i])};
        vnum b = v_dot(eye, direction, f);
        take_nearer(i, b, v_add(v_mul(b, b, f), v_splat(scene->minus_c[i])), &hit, f);
    }
    hit.found = v_cmp_lt(v_splat(-1), hit.shape);
    return hit;
}

// From the centre of sphere i to the rays' origins.
static struct vec from_centre(const struct packet *rays, int i, const struct scene_tables *scene) {
    return (struct vec){v_sub(rays->origin.x, v_splat(scene->centre[0][i])),
                        v_sub(rays->origin.y, v_splat(scene->centre[1][i])),
                        v_sub(rays->origin.z, v_splat(scene->centre[2][i]))};
}

// Returns the first hits of the active rays among all spheres.
static struct hit intersect(const struct packet *rays, const struct scene_tables *scene) {
    const struct format *f = &scene->format;
    struct hit hit = no_hit();
    for (int i = 0; i < scene->count; i++) {
        struct vec from = from_centre(rays, i, scene);
        vnum b = v_dot(from, rays->direction, f);
        vnum discriminant =
            v_add(v_sub(v_mul(b, b, f), v_dot(from, from, f)), v_splat(scene->radius_sq[i]));
        take_nearer(i, b, v_select(rays->active, discriminant, v_splat(0)), &hit, f);
    }
    hit.found = v_and(rays->active, v_cmp_lt(v_splat(-1), hit.shape));
    return hit;
}

// Returns the active rays that hit a sphere before t = far. A ray that has hit one is not tested again.
static vmask occluded(struct packet rays, vnum far, const struct scene_tables *scene) {
    const struct format *f = &scene->format;
    vmask dark = v_andnot(rays.active, rays.active);
    for (int i = 0; i < scene->count; i++) {
        struct vec from = from_centre(&rays, i, scene);
        vnum b = v_dot(from, rays.direction, f);
        vnum discriminant =
            v_add(v_sub(v_mul(b, b, f), v_dot(from, from, f)), v_splat(scene->radius_sq[i]));
        vmask ahead = v_and(v_and(rays.active, v_positive(discriminant)), v_cmp_lt(b, v_splat(0)));
        if (!v_any(ahead))
            continue;
        vnum t = v_sub(v_sub(v_splat(0), b), v_root(discriminant, f));
        vmask hit = v_and(v_and(ahead, v_positive(t)), v_cmp_lt(t, far));
        dark = v_or(hit, dark);
        rays.active = v_andnot(hit, rays.active);
        if (!v_any(rays.active))
            break;
    }
    return dark;
}
