// Shading and the loop over mirror bounces, in the phase's numbers. The model is this study's (results/README.md).
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
// A header, as all of it must be inlined into each build of tile.c, which includes intersect.h before it.
#pragma once

struct shaded {
    struct vec colour, normal; // the normal is the first hit's
    struct hit hit;            // of the camera ray
};

// Returns x^k for 0 ≤ x ≤ 1 and a whole k of each lane's own, by repeated squaring.
static vnum power(vnum x, vnum k, const struct scene_tables *scene) {
    const struct format *f = &scene->format;
    vnum y = v_splat(scene->one);
    for (int i = 0; i < scene->shininess_bits; i++) {
        y = v_select(v_test_bit(k, i), v_mul(y, x, f), y);
        x = v_mul(x, x, f);
    }
    return y;
}

// Returns `a`, at most the largest factor of a product.
static vnum limited(vnum a) {
    return v_select(v_cmp_lt(a, v_splat(LARGEST_FACTOR)), a, v_splat(LARGEST_FACTOR));
}

// Returns the light that a hit at p reflects along the ray: ambient, diffuse and specular, with a hard shadow.
// n is the normal at p, `direction` the ray's.
static struct vec direct_light(struct vec p, struct vec n, struct vec direction,
                               const struct hit *hit, const struct scene_tables *scene) {
    const struct format *f = &scene->format;
    const vnum ambient = v_splat(scene->ambient);
    struct vec base = vec_gather(scene->colour, hit->shape);
    struct vec colour = {v_mul(base.x, ambient, f), v_mul(base.y, ambient, f),
                         v_mul(base.z, ambient, f)};
    struct reciprocal distance;
    struct vec to_light = vec_sub(vec_splat(scene->light), p),
               l = normalize(to_light, f, &distance);
    vnum cosine = v_dot(n, l, f);
    vmask lit = v_and(hit->found, v_positive(cosine));
    if (scene->shadows && v_any(lit)) {
        struct packet rays = {vec_madd(p, l, v_splat(scene->surface_offset), f), l, lit};
        lit = v_andnot(occluded(rays, v_dot(to_light, l, f), scene), lit);
    }
    if (!v_any(lit))
        return colour;
    // The light's direction mirrored at the normal, times the ray's: minus the paper's R.
    vnum twice = v_add(cosine, cosine);
    vnum shine = v_sub(v_dot(l, direction, f), v_mul(twice, v_dot(n, direction, f), f));
    vnum one = v_splat(scene->one);
    shine = v_select(v_cmp_lt(shine, one), shine, one);
    vnum specular = v_select(
        v_positive(shine), power(shine, v_lookup(scene->shininess, hit->shape), scene), v_splat(0));
    specular = v_mul(specular, v_splat(scene->specular), f);
    const scalar *e = scene->emission;
    struct vec reach = {limited(times_reciprocal(v_splat(e[0]), distance)),
                        limited(times_reciprocal(v_splat(e[1]), distance)),
                        limited(times_reciprocal(v_splat(e[2]), distance))};
    struct vec light = {
        v_add(colour.x, v_mul(reach.x, v_add(v_mul(base.x, cosine, f), specular), f)),
        v_add(colour.y, v_mul(reach.y, v_add(v_mul(base.y, cosine, f), specular), f)),
        v_add(colour.z, v_mul(reach.z, v_add(v_mul(base.z, cosine, f), specular), f)),
    };
    light = (struct vec){limited(light.x), limited(light.y), limited(light.z)};
    return vec_chosen(lit, light, colour);
}

// Returns the unit normal of the sphere that was hit, at p; of lanes without a hit, of the first sphere.
static struct vec surface_normal(struct vec p, const struct hit *hit,
                                 const struct scene_tables *scene) {
    struct reciprocal unused;
    vnum shape = v_select(hit->found, hit->shape, v_splat(0));
    return normalize(vec_sub(p, vec_gather(scene->centre, shape)), &scene->format, &unused);
}

// Returns colour, normal and first hit of camera rays. Each bounce adds the light of its hit, or the background,
// times the product of the mirrors before it. `candidates`: the spheres that the camera rays can hit.
static struct shaded trace(struct packet rays, const struct scene_tables *scene,
                           const int *candidates, int count) {
    const struct format *f = &scene->format;
    const struct vec background = vec_splat(scene->background);
    struct shaded result = {.hit = intersect_camera_rays(rays.direction, scene, candidates, count)};
    result.hit.found = v_and(rays.active, result.hit.found);
    result.colour = result.normal = (struct vec){v_splat(0), v_splat(0), v_splat(0)};
    if (!v_any(result.hit.found))
        return result;
    struct hit hit = result.hit;
    vnum weight = v_splat(scene->one);
    rays.active = hit.found;
    for (int bounce = 0;; bounce++) {
        vnum t = v_select(hit.found, hit.t, v_splat(0));
        struct vec p = vec_madd(rays.origin, rays.direction, t, f);
        hit.shape = v_select(hit.found, hit.shape, v_splat(0));
        struct vec n = surface_normal(p, &hit, scene);
        if (bounce == 0)
            result.normal = n;
        struct vec light = direct_light(p, n, rays.direction, &hit, scene);
        light = vec_chosen(hit.found, light, vec_chosen(rays.active, background, result.colour));
        struct vec sum = vec_madd(result.colour, light, weight, f);
        result.colour = vec_chosen(rays.active, sum, result.colour);
        weight = v_mul(weight, v_lookup(scene->mirror_weight, hit.shape), f);
        rays.active = v_and(hit.found, v_positive(weight));
        if (bounce == scene->bounces || !v_any(rays.active))
            return result;
        vnum twice = v_dot(rays.direction, n, f);
        twice = v_sub(v_splat(0), v_add(twice, twice));
        rays.direction = vec_madd(rays.direction, n, twice, f);
        rays.origin = vec_madd(p, n, v_splat(scene->surface_offset), f);
        hit = intersect(&rays, scene);
    }
}
