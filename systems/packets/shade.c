// Shades hits: normals in closed form, light by B. T. Phong, "Illumination for computer generated
// pictures", CACM 18 (1975). Shadow rays go from the light to all points of a batch. Mirror rays
// are packed into new packets. Shadow packets by start and end points: J. Bikker, "Architecture of
// a Real-Time Ray-Tracer".
#include "shade.h"

#include "ray_arrays.h"
#include "simd/simd.h"
#include "solids.h"

// What shading needs of a packet's hits.
struct surface {
    struct vec normal, color;
    vfloat share, shininess;
};

static struct vec normal_on(const struct primitive *s, struct vec p) {
    vfloat one = v_splat(1.0f), tiny = v_splat(1e-30f);
    switch (s->type) {
    case SHAPE_SPHERE: return vec_scale(p, one / v_max(vec_norm(p), tiny));
    case SHAPE_BOX: {
        vfloat x = v_abs(p.x) - v_splat(s->size[0]), y = v_abs(p.y) - v_splat(s->size[1]);
        vfloat z = v_abs(p.z) - v_splat(s->size[2]);
        vmask on_x = v_and(v_cmp_ge(x, y), v_cmp_ge(x, z)), on_y = v_andnot(on_x, v_cmp_ge(y, z));
        vfloat side = v_select(v_or(on_x, on_y), v_splat(0.0f), one);
        return (struct vec){v_copysign(v_select_or_zero(on_x, one), p.x),
                            v_copysign(v_select_or_zero(on_y, one), p.y), v_copysign(side, p.z)};
    }
    default: { // cone
        vfloat radius = vec_norm((struct vec){p.x, v_splat(0.0f), p.z}), k = v_splat(s->size[1]);
        vfloat side = (radius - v_madd(k, p.y, v_splat(s->size[2]))) * v_splat(s->cosine);
        vmask cap = v_cmp_gt(v_abs(p.y) - v_splat(s->size[0]), side);
        vfloat out = v_select(cap, v_splat(0.0f), v_splat(s->cosine) / v_max(radius, tiny));
        return (struct vec){
            p.x * out, v_select(cap, v_copysign(one, p.y), v_splat(0.0f) - k * v_splat(s->cosine)),
            p.z * out};
    }
    }
}

static struct vec turned(const struct primitive *s, struct vec v) {
    if (!s->turned)
        return v;
    return (struct vec){vec_dot(vec_set(s->turn[0]), v), vec_dot(vec_set(s->turn[1]), v),
                        vec_dot(vec_set(s->turn[2]), v)};
}

static struct vec turned_back(const struct primitive *s, struct vec v) {
    if (!s->turned)
        return v;
    struct vec x = vec_scale(vec_set(s->turn[0]), v.x);
    x = vec_along(x, vec_set(s->turn[1]), v.y);
    return vec_along(x, vec_set(s->turn[2]), v.z);
}

// Returns the hit in the solid's frame. It is reached from the point of the ray nearest to the
// centre, which keeps more digits than the way from the origin.
static struct vec local_point(const struct primitive *s, struct vec o, struct vec d, vfloat t) {
    struct vec m = {o.x - v_splat(s->position[0]), o.y - v_splat(s->position[1]),
                    o.z - v_splat(s->position[2])};
    vfloat before = v_splat(0.0f) - vec_dot(m, d);
    return turned(s, vec_along(vec_along(m, d, before), d, t - before));
}

// Returns the surfaces at the hits, shape by shape. Only shapes that were hit have their material
// and normal loaded.
static struct surface surface_at(const struct prepared *scene, vmask found, struct vec o,
                                 struct vec d, vfloat t, const float *shape) {
    struct vec none = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    struct surface all = {none, none, v_splat(0.0f), v_splat(1.0f)};
    vfloat shapes = v_load(shape);
    for (unsigned rest = v_mask_bits(found); rest;) {
        float index = shape[__builtin_ctz(rest)];
        const struct primitive *s = &scene->primitives[(int)index];
        vmask same = v_and(found, v_cmp_eq(shapes, v_splat(index)));
        rest &= ~v_mask_bits(same);
        struct vec n = vec_set(s->normal);
        if (s->type != SHAPE_PLANE)
            n = turned_back(s, normal_on(s, local_point(s, o, d, t)));
        all.normal = vec_select(same, n, all.normal);
        all.color = vec_select(same, vec_set(s->color), all.color);
        all.share = v_select(same, v_splat(s->share), all.share);
        all.shininess = v_select(same, v_splat(s->shininess), all.shininess);
    }
    vmask away = v_cmp_gt(vec_dot(all.normal, d), v_splat(0.0f));
    all.normal =
        (struct vec){v_negate_where(away, all.normal.x), v_negate_where(away, all.normal.y),
                     v_negate_where(away, all.normal.z)};
    return all;
}

static void add_color(struct worker_scratch *scratch, vmask m, struct vec color,
                      const float *pixel) {
    float lanes[3][LANES];
    v_store(color.x, lanes[0]);
    v_store(color.y, lanes[1]);
    v_store(color.z, lanes[2]);
    for (unsigned rest = v_mask_bits(m); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), i = (int)pixel[lane];
        for (int k = 0; k < 3; k++)
            scratch->color[k][i] += lanes[k][lane];
    }
}

// Hits, and the path from the light to them.
struct lighting {
    struct vec point, from_light; // unit, from the light to the point
    vfloat distance, facing, specular;
    vmask front;
};

static struct lighting lighting_at(const struct tile_context *context, vmask found, struct vec p,
                                   struct vec d, const struct surface *surface) {
    const double *light = context->view->light_position;
    bool newton = context->scene->settings.newton;
    vfloat zero = v_splat(0.0f);
    // The shadow ray joins the light and the hit.
    struct vec l = {p.x - v_splat((float)light[0]), p.y - v_splat((float)light[1]),
                    p.z - v_splat((float)light[2])};
    vfloat square = vec_dot(l, l), per = inverse_sqrt(square, newton);
    struct lighting at = {.point = p, .from_light = vec_scale(l, per), .distance = square * per};
    at.facing = zero - vec_dot(surface->normal, at.from_light);
    at.front = v_and(found, v_and(v_cmp_gt(at.facing, zero), v_cmp_gt(square, zero)));
    at.specular = zero;
    // The paper's R·V: R is the direction from the light, mirrored; V points against the ray.
    vfloat shine = zero - vec_dot(vec_reflect(at.from_light, surface->normal), d);
    vmask shines = v_and(at.front, v_cmp_gt(shine, zero));
    if (v_any(shines)) {
        vfloat power = v_pow(v_max(shine, v_splat(1e-30f)), surface->shininess);
        at.specular = v_select_or_zero(shines, v_splat(0.2f) * power);
    }
    return at;
}

// Queues a shadow ray for each hit that faces the light. It adds the light `bright` if nothing blocks it.
static void queue_shadow_rays(const struct tile_context *context, const struct lighting *at,
                              struct vec bright, int first) {
    struct worker_scratch *scratch = context->scratch;
    int to = scratch->shadows;
    pack_vec(at->front, at->from_light, scratch->shadow_direction, to);
    pack_vec(at->front, bright, scratch->shadow_light, to);
    vfloat start = v_splat((float)context->scene->model.march.surface_offset);
    v_compress_store(at->front, at->distance - start, scratch->shadow_far + to);
    v_compress_store(at->front, v_load(scratch->rays.pixel + first), scratch->shadow_pixel + to);
    v_compress_store(at->front, v_load(scratch->shape + first), scratch->shadow_excluded + to);
    scratch->shadows += v_count(at->front);
}

// Rays of a packet.
struct ray {
    struct vec point, direction;
};

// Queues a mirror ray for each hit in `mirrors`, for the next batch. `excluded`: the shapes that they
// start on.
static void queue_mirror_rays(const struct tile_context *context, vmask mirrors, struct ray from,
                              struct vec normal, vfloat weight, vfloat excluded, int first) {
    struct worker_scratch *scratch = context->scratch;
    struct tile_rays *rays = &scratch->rays;
    struct tile_rays *to = &scratch->mirrored;
    vfloat offset = v_splat((float)context->scene->model.march.surface_offset);
    pack_vec(mirrors, vec_along(from.point, normal, offset), to->origin, to->count);
    pack_vec(mirrors, vec_reflect(from.direction, normal), to->direction, to->count);
    v_compress_store(mirrors, weight, to->weight + to->count);
    v_compress_store(mirrors, v_load(rays->pixel + first), to->pixel + to->count);
    v_compress_store(mirrors, excluded, to->excluded + to->count);
    to->count += v_count(mirrors);
}

static struct ray load_ray(const struct tile_rays *rays, int first) {
    const float *const origin[3] = {rays->origin[0], rays->origin[1], rays->origin[2]};
    const float *const direction[3] = {rays->direction[0], rays->direction[1], rays->direction[2]};
    return (struct ray){load_vec(origin, first), load_vec(direction, first)};
}

// Returns the light that a hit sends along its ray if no shape blocks the light, scaled by
// `reach`.
static struct vec light_sent(const struct lighting *at, struct vec base, const double *emission,
                             vfloat reach) {
    struct vec e = vec_from_doubles(emission);
    return (struct vec){e.x * v_madd(base.x, at->facing, at->specular) * reach,
                        e.y * v_madd(base.y, at->facing, at->specular) * reach,
                        e.z * v_madd(base.z, at->facing, at->specular) * reach};
}

static struct vec add_where(vmask m, struct vec color, struct vec more) {
    return (struct vec){color.x + v_select_or_zero(m, more.x),
                        color.y + v_select_or_zero(m, more.y),
                        color.z + v_select_or_zero(m, more.z)};
}

// Shades the packet of rays from number `first` on. Shadow and mirror rays are queued.
static void shade_packet(const struct tile_context *context, int bounce, bool normals, int first) {
    const struct model *model = &context->scene->model;
    struct worker_scratch *scratch = context->scratch;
    struct tile_rays *rays = &scratch->rays;
    float *hit_t = scratch->t + first, *shape = scratch->shape + first;
    struct ray ray = load_ray(rays, first);
    struct vec o = ray.point, d = ray.direction;
    vfloat t = v_load(hit_t), weight = v_load(rays->weight + first), zero = v_splat(0.0f);
    vmask active = v_mask_first(rays->count - first),
          found = v_and(active, v_cmp_lt(t, v_splat(INFINITY)));
    struct vec p = vec_along(o, d, t);
    float bounds = (float)(model->march.bounds_radius * model->march.bounds_radius);
    vfloat far_sq = vec_dot(p, p);
    found = v_and(found, v_cmp_ge(v_splat(bounds), far_sq));
    v_store(v_select(found, t, v_splat(INFINITY)), hit_t);
    v_store(v_select(found, v_load(shape), v_splat(-1.0f)), shape);
    struct vec color = vec_scale(vec_from_doubles(model->background), weight);
    if (v_any(found)) {
        struct surface surface = surface_at(context->scene, found, o, d, t, shape);
        if (normals)
            store_vec(surface.normal, scratch->normal, first);
        if (model->features.fog)
            weight = weight * v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq));
        vfloat within = v_splat((float)-model->march.surface_offset);
        struct lighting at = lighting_at(context, found, p, d, &surface);
        color = vec_select(found, vec_scale(surface.color, weight * v_splat(0.01f)), color);
        if (v_any(at.front)) {
            struct vec bright =
                light_sent(&at, surface.color, context->view->light_emission, weight / at.distance);
            if (model->shadows == SHADOWS_NONE) {
                color = add_where(at.front, color, bright);
            } else {
                // A ray that started inside of a solid has its hit in it: no light.
                at.front = v_andnot(v_cmp_lt(t, within), at.front);
                queue_shadow_rays(context, &at, bright, first);
            }
        }
        vmask mirrors = v_and(found, v_cmp_gt(surface.share, zero));
        if (model->features.mirrors && bounce < model->march.max_bounces && v_any(mirrors)) {
            // A ray that started inside of a solid may hit that solid again.
            vfloat excluded = v_select(v_cmp_lt(t, within), v_splat(-1.0f), v_load(shape));
            queue_mirror_rays(context, mirrors, (struct ray){p, d}, surface.normal,
                              weight * surface.share, excluded, first);
        }
    } else if (normals) {
        store_vec((struct vec){zero, zero, zero}, scratch->normal, first);
    }
    add_color(scratch, active, color, rays->pixel + first);
}

// Sets where shadow rays from a light outside of the bounds begin: where they enter the bounds. A
// march ends at the bounds, so shapes beyond them cast no shadow.
static void begin_at_bounds(const struct tile_context *context, float *from) {
    const double *l = context->view->light_position;
    double radius = context->scene->model.march.bounds_radius;
    vfloat outside = v_splat((float)(l[0] * l[0] + l[1] * l[1] + l[2] * l[2] - radius * radius));
    struct worker_scratch *scratch = context->scratch;
    const float *const d_of[3] = {scratch->shadow_direction[0], scratch->shadow_direction[1],
                                  scratch->shadow_direction[2]};
    for (int i = 0; i < scratch->shadows; i += LANES) {
        vfloat along = v_splat(0.0f) - vec_dot(vec_from_doubles(l), load_vec(d_of, i));
        vfloat half = v_sqrt(v_max(v_msub(along, along, outside), v_splat(0.0f)));
        v_store(v_max(along - half, v_splat(0.0f)), from + i);
    }
}

// Traces the queued shadow rays, and adds the light of those that nothing blocks.
static void cast_shadows(const struct tile_context *context) {
    struct worker_scratch *scratch = context->scratch;
    const double *l = context->view->light_position;
    double radius = context->scene->model.march.bounds_radius;
    bool beyond = l[0] * l[0] + l[1] * l[1] + l[2] * l[2] > radius * radius;
    if (beyond)
        begin_at_bounds(context, scratch->shadow_near);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < scratch->shadows; i += LANES)
            v_store(v_splat((float)l[k]), scratch->shadow_origin[k] + i);
    struct ray_batch batch = {
        {scratch->shadow_origin[0], scratch->shadow_origin[1], scratch->shadow_origin[2]},
        {scratch->shadow_direction[0], scratch->shadow_direction[1], scratch->shadow_direction[2]},
        beyond ? scratch->shadow_near : NULL,
        scratch->shadow_far,
        scratch->shadow_excluded,
        scratch->shadows,
    };
    find_occluded(context->scene, &batch, scratch->shadow_t);
    const float *const bright[3] = {scratch->shadow_light[0], scratch->shadow_light[1],
                                    scratch->shadow_light[2]};
    for (int i = 0; i < scratch->shadows; i += LANES) {
        vmask open = v_and(v_mask_first(scratch->shadows - i),
                           v_cmp_gt(v_load(scratch->shadow_t + i), v_splat(-INFINITY)));
        add_color(scratch, open, load_vec(bright, i), scratch->shadow_pixel + i);
    }
}

void shade_batch(const struct tile_context *context, int bounce, bool normals) {
    struct worker_scratch *scratch = context->scratch;
    scratch->shadows = scratch->mirrored.count = 0;
    for (int first = 0; first < scratch->rays.count; first += LANES)
        shade_packet(context, bounce, normals, first);
    if (scratch->shadows > 0)
        cast_shadows(context);
}
