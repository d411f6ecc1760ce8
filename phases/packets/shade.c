// What hits look like: normals in closed form, light (B. T. Phong, "Illumination for computer generated pictures",
// CACM 18 (1975)), shadow rays from the light to all points of a batch, mirror rays packed anew.
// Shadow packets by start and end points: J. Bikker, "Architecture of a Real-Time Ray-Tracer".
#include "trace.h"

// Of a packet's hits: what shading needs.
struct surface {
    struct vec normal, color;
    real share, shininess;
};

static struct vec normal_on(const struct placed *s, struct vec p) {
    COUNT(normal_on, call);
    real one = set(1.0f), tiny = set(1e-30f);
    switch (s->type) {
    case SHAPE_SPHERE:
        COUNT(normal_on, sphere);
        return vec_scale(p, one / most_of(vec_norm(p), tiny));
    case SHAPE_BOX: {
        COUNT(normal_on, box);
        real x = absolute(p.x) - set(s->size[0]), y = absolute(p.y) - set(s->size[1]);
        real z = absolute(p.z) - set(s->size[2]);
        mask on_x = both(not_less(x, y), not_less(x, z)), on_y = but_not(on_x, not_less(y, z));
        real side = choose(either(on_x, on_y), set(0.0f), one);
        return (struct vec){with_sign_of(p.x, keep(on_x, one)), with_sign_of(p.y, keep(on_y, one)),
                            with_sign_of(p.z, side)};
    }
    default: { // cone
        COUNT(normal_on, cone);
        real radius = vec_norm((struct vec){p.x, set(0.0f), p.z}), k = set(s->size[1]);
        real side = (radius - mul_add(k, p.y, set(s->size[2]))) * set(s->cosine);
        mask cap = greater(absolute(p.y) - set(s->size[0]), side);
        real out = choose(cap, set(0.0f), set(s->cosine) / most_of(radius, tiny));
        return (struct vec){p.x * out,
                            choose(cap, with_sign_of(p.y, one), set(0.0f) - k * set(s->cosine)),
                            p.z * out};
    }
    }
}

static struct vec turned(const struct placed *s, struct vec v) {
    COUNT(turned, call);
    if (!s->turned)
        return v;
    COUNT(turned, rotation);
    return (struct vec){vec_dot(vec_set(s->turn[0]), v), vec_dot(vec_set(s->turn[1]), v),
                        vec_dot(vec_set(s->turn[2]), v)};
}

static struct vec turned_back(const struct placed *s, struct vec v) {
    COUNT(turned_back, call);
    if (!s->turned)
        return v;
    COUNT(turned_back, rotation);
    struct vec x = vec_scale(vec_set(s->turn[0]), v.x);
    x = vec_along(x, vec_set(s->turn[1]), v.y);
    return vec_along(x, vec_set(s->turn[2]), v.z);
}

// The hit in the solid's frame, by way of where the ray is nearest to its centre.
static struct vec local_point(const struct placed *s, struct vec o, struct vec d, real t) {
    struct vec m = {o.x - set(s->position[0]), o.y - set(s->position[1]),
                    o.z - set(s->position[2])};
    real before = set(0.0f) - vec_dot(m, d);
    return turned(s, vec_along(vec_along(m, d, before), d, t - before));
}

// Once for each shape that the packet hit: what is cold is touched by hits alone.
static struct surface surface_at(const struct prepared *scene, mask found, struct vec o,
                                 struct vec d, real t, const float *shape) {
    COUNT(surface_at, call);
    struct vec none = {set(0.0f), set(0.0f), set(0.0f)};
    struct surface all = {none, none, set(0.0f), set(1.0f)};
    real shapes = load(shape);
    for (unsigned rest = bits(found); rest;) {
        COUNT(surface_at, shape);
        float index = shape[__builtin_ctz(rest)];
        const struct placed *s = &scene->placed[(int)index];
        mask same = both(found, equal(shapes, set(index)));
        rest &= ~bits(same);
        struct vec n = vec_set(s->normal);
        if (s->type != SHAPE_PLANE) {
            COUNT(surface_at, solid);
            n = turned_back(s, normal_on(s, local_point(s, o, d, t)));
        }
        all.normal = vec_choose(same, n, all.normal);
        all.color = vec_choose(same, vec_set(s->color), all.color);
        all.share = choose(same, set(s->share), all.share);
        all.shininess = choose(same, set(s->shininess), all.shininess);
    }
    mask away = greater(vec_dot(all.normal, d), set(0.0f));
    all.normal = (struct vec){negate_where(away, all.normal.x), negate_where(away, all.normal.y),
                              negate_where(away, all.normal.z)};
    return all;
}

static void add_color(struct desk *desk, mask m, struct vec color, const float *pixel) {
    COUNT(add_color, call);
    float lanes[3][LANES];
    unload(color.x, lanes[0]);
    unload(color.y, lanes[1]);
    unload(color.z, lanes[2]);
    for (unsigned rest = bits(m); rest; rest &= rest - 1) {
        COUNT(add_color, lane);
        int lane = __builtin_ctz(rest), i = (int)pixel[lane];
        for (int k = 0; k < 3; k++)
            desk->color[k][i] += lanes[k][lane];
    }
}

// A hit and the way to the light.
struct lit {
    struct vec point, from_light; // unit, from the light to the point
    real distance, facing, specular;
    mask lit;
};

static struct lit light_on(const struct work *work, mask found, struct vec p, struct vec d,
                           const struct surface *surface) {
    COUNT(light_on, call);
    const double *light = work->view->light_position;
    bool newton = work->scene->settings.newton;
    real zero = set(0.0f);
    // From both ends of the shadow ray: it is what joins them.
    struct vec l = {p.x - set((float)light[0]), p.y - set((float)light[1]),
                    p.z - set((float)light[2])};
    real square = vec_dot(l, l), per = inverse_root(square, newton);
    struct lit at = {.point = p, .from_light = vec_scale(l, per), .distance = square * per};
    at.facing = zero - vec_dot(surface->normal, at.from_light);
    at.lit = both(found, both(greater(at.facing, zero), greater(square, zero)));
    at.specular = zero;
    // The paper's R·V: of the way from the light, mirrored, against the ray.
    real shine = zero - vec_dot(vec_reflect(at.from_light, surface->normal), d);
    mask shines = both(at.lit, greater(shine, zero));
    if (any(shines)) {
        COUNT(light_on, shines);
        real power = power_of(most_of(shine, set(1e-30f)), surface->shininess);
        at.specular = keep(shines, set(0.2f) * power);
    }
    return at;
}

// What the light would bring, and the ray that says whether it does.
static void cast(const struct work *work, const struct lit *at, struct vec bright, int first) {
    COUNT(cast, call);
    struct desk *desk = work->desk;
    int to = desk->shadows;
    pack_vec(at->lit, at->from_light, desk->to_point, to);
    pack_vec(at->lit, bright, desk->lit, to);
    real start = set((float)work->scene->model.march.surface_offset);
    pack(at->lit, at->distance - start, desk->length + to);
    pack(at->lit, load(desk->rays.pixel + first), desk->slot + to);
    pack(at->lit, load(desk->shape + first), desk->lit_own + to);
    desk->shadows += count_of(at->lit);
}

// Rays of a packet.
struct ray {
    struct vec point, direction;
};

// What the hits in `mirrors` see waits for the next round. own: the shapes that they are on.
static void reflect(const struct work *work, mask mirrors, struct ray from, struct vec normal,
                    real weight, real own, int first) {
    struct desk *desk = work->desk;
    struct rays *rays = &desk->rays;
    COUNT(reflect, call);
    struct rays *to = &desk->mirrored;
    real offset = set((float)work->scene->model.march.surface_offset);
    pack_vec(mirrors, vec_along(from.point, normal, offset), to->origin, to->count);
    pack_vec(mirrors, vec_reflect(from.direction, normal), to->direction, to->count);
    pack(mirrors, weight, to->weight + to->count);
    pack(mirrors, load(rays->pixel + first), to->pixel + to->count);
    pack(mirrors, own, to->own + to->count);
    to->count += count_of(mirrors);
}

static void shade_packet(const struct work *work, int bounce, bool normals, int first) {
    ACTIVE(count_of(first_lanes(work->desk->rays.count - first)));
    COUNT(shade_packet, call);
    COUNT(shade_packet, scalar);
    const struct prepared *scene = work->scene;
    const struct model *model = &scene->model;
    struct desk *desk = work->desk;
    struct rays *rays = &desk->rays;
    const float *const o_of[3] = {rays->origin[0], rays->origin[1], rays->origin[2]};
    const float *const d_of[3] = {rays->direction[0], rays->direction[1], rays->direction[2]};
    struct vec o = load_vec(o_of, first), d = load_vec(d_of, first);
    real t = load(desk->t + first), weight = load(rays->weight + first), zero = set(0.0f);
    mask active = first_lanes(rays->count - first), found = both(active, less(t, set(INFINITY)));
    struct vec p = vec_along(o, d, t);
    float bounds = (float)(model->march.bounds_radius * model->march.bounds_radius);
    real far_sq = vec_dot(p, p);
    found = both(found, not_less(set(bounds), far_sq));
    unload(choose(found, t, set(INFINITY)), desk->t + first);
    unload(choose(found, load(desk->shape + first), set(-1.0f)), desk->shape + first);
    struct vec color = vec_scale(vec_doubles(model->background), weight);
    if (any(found)) {
        ACTIVE(count_of(found));
        COUNT(shade_packet, found);
        struct surface surface = surface_at(scene, found, o, d, t, desk->shape + first);
        if (normals)
            unload_vec(surface.normal, desk->normal, first);
        if (model->features.fog) {
            COUNT(shade_packet, fog);
            weight = weight * exp_of(set((float)-model->fog) * far_sq * root(far_sq));
        }
        struct lit at = light_on(work, found, p, d, &surface);
        color = vec_choose(found, vec_scale(surface.color, weight * set(0.01f)), color);
        if (any(at.lit)) {
            COUNT(shade_packet, lit);
            struct vec e = vec_doubles(work->view->light_emission), base = surface.color;
            real reach = weight / at.distance;
            struct vec bright = {e.x * mul_add(base.x, at.facing, at.specular) * reach,
                                 e.y * mul_add(base.y, at.facing, at.specular) * reach,
                                 e.z * mul_add(base.z, at.facing, at.specular) * reach};
            if (model->shadows == SHADOWS_NONE) {
                COUNT(shade_packet, unshadowed);
                color =
                    (struct vec){color.x + keep(at.lit, bright.x), color.y + keep(at.lit, bright.y),
                                 color.z + keep(at.lit, bright.z)};
            } else {
                COUNT(shade_packet, shadowed);
                // A ray that started inside of a solid is hit there, and so is its shadow ray.
                real within = set((float)-model->march.surface_offset);
                at.lit = but_not(less(t, within), at.lit);
                cast(work, &at, bright, first);
            }
        }
        mask mirrors = both(found, greater(surface.share, zero));
        if (model->features.mirrors && bounce < model->march.max_bounces && any(mirrors)) {
            COUNT(shade_packet, mirrors);
            // A ray that started inside of a solid was hit there, not on its surface; so may the next one be.
            real own = choose(less(t, set((float)-model->march.surface_offset)), set(-1.0f),
                              load(desk->shape + first));
            reflect(work, mirrors, (struct ray){p, d}, surface.normal, weight * surface.share, own,
                    first);
        }
    } else if (normals) {
        unload_vec((struct vec){zero, zero, zero}, desk->normal, first);
    }
    add_color(desk, active, color, rays->pixel + first);
}

// A march ends at the bounds: what lies beyond them is in nobody's way. From a light out there the ray begins where it
// comes in.
static void begin_at_bounds(const struct work *work, float *from) {
    COUNT(begin_at_bounds, call);
    const double *l = work->view->light_position;
    double radius = work->scene->model.march.bounds_radius;
    real outside = set((float)(l[0] * l[0] + l[1] * l[1] + l[2] * l[2] - radius * radius));
    struct desk *desk = work->desk;
    const float *const d_of[3] = {desk->to_point[0], desk->to_point[1], desk->to_point[2]};
    for (int i = 0; i < desk->shadows; i += LANES) {
        COUNT(begin_at_bounds, packet);
        real along = set(0.0f) - vec_dot(vec_doubles(l), load_vec(d_of, i));
        real half = root(most_of(mul_sub(along, along, outside), set(0.0f)));
        unload(most_of(along - half, set(0.0f)), from + i);
    }
}

static void cast_shadows(const struct work *work) {
    COUNT(cast_shadows, call);
    struct desk *desk = work->desk;
    const double *l = work->view->light_position;
    double radius = work->scene->model.march.bounds_radius;
    bool beyond = l[0] * l[0] + l[1] * l[1] + l[2] * l[2] > radius * radius;
    if (beyond)
        begin_at_bounds(work, desk->skipped);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < desk->shadows; i += LANES)
            unload(set((float)l[k]), desk->from_light[k] + i);
    struct beams beams = {
        {desk->from_light[0], desk->from_light[1], desk->from_light[2]},
        {desk->to_point[0], desk->to_point[1], desk->to_point[2]},
        beyond ? desk->skipped : NULL,
        desk->length,
        desk->lit_own,
        desk->shadows,
    };
    blocked(work->scene, &beams, desk->reach);
    const float *const lit[3] = {desk->lit[0], desk->lit[1], desk->lit[2]};
    for (int i = 0; i < desk->shadows; i += LANES) {
        COUNT(cast_shadows, packet);
        mask open =
            both(first_lanes(desk->shadows - i), greater(load(desk->reach + i), set(-INFINITY)));
        add_color(desk, open, load_vec(lit, i), desk->slot + i);
    }
}

void shade(const struct work *work, int bounce, bool normals) {
    COUNT(shade, call);
    struct desk *desk = work->desk;
    desk->shadows = desk->mirrored.count = 0;
    for (int first = 0; first < desk->rays.count; first += LANES)
        shade_packet(work, bounce, normals, first);
    if (desk->shadows > 0)
        cast_shadows(work);
}
