// What a hit looks like: normal, light (B. T. Phong, "Illumination for computer generated
// pictures", CACM 18 (1975)), fog; and what has to wait for a shadow or a mirror ray.
#include "simd/permute.h"
#include "simd/point.h"
#include "simd/pow.h"
#include "streams.h"

// Materials of hits.
struct surface {
    struct vec color;
    vfloat share, shininess, shine_from;
};

// Once for each shape that the packet hit.
static struct surface surface_of(const struct hit *hit, const struct prepared *scene) {
    COUNT(surface_of, call);
    float id[LANES];
    v_store(hit->shape, id);
    struct surface all = {0};
    for (unsigned rest = v_mask_bits(hit->found); rest;) {
        COUNT(surface_of, shape);
        const struct placed *s = &scene->placed[(int)id[__builtin_ctz(rest)]];
        vmask same = v_and(hit->found, same_shape(hit->shape, (int)s->index));
        rest &= ~v_mask_bits(same);
        all.color = vec_select(same, vec_set(s->color), all.color);
        all.share = v_select(same, v_splat(s->share), all.share);
        all.shininess = v_select(same, v_splat(s->shininess), all.shininess);
        all.shine_from = v_select(same, v_splat(s->shine_from), all.shine_from);
    }
    return all;
}

// Normals. The scene asks for forward differences of its distance over normal_step; in float they
// are noise in the third digit (an ulp of the point over 1e-4). So the gradient of the shape that
// was hit, in closed form, stands where the two agree to that noise. Where they do not, within a
// step of an edge, the shape's difference stands; and where another shape is within reach of the
// step, as where two touch, the difference of the whole scene. The Mandelbulb has only differences.
// Gradients are in the world's axes in the end, and need not be of unit length.
static struct vec box_gradient(struct vec p, const struct placed *s) {
    COUNT(box_gradient, call);
    vfloat zero = v_splat(0.0f);
    vfloat x = v_abs(p.x) - v_splat(s->size[0]);
    vfloat y = v_abs(p.y) - v_splat(s->size[1]);
    vfloat z = v_abs(p.z) - v_splat(s->size[2]);
    vfloat most = v_max(x, v_max(y, z));
    // Outside: away from the nearest point. Inside: along the axis of the nearest face.
    vmask outside = v_cmp_gt(most, zero), on_x = v_cmp_ge(x, most), on_y = v_cmp_ge(y, most);
    vfloat one = v_splat(1.0f);
    struct vec face = {v_select_or_zero(on_x, one), v_select_or_zero(v_andnot(on_x, on_y), one),
                       v_zero_where(v_or(on_x, on_y), one)};
    struct vec away = {v_max(x, zero), v_max(y, zero), v_max(z, zero)};
    struct vec g = vec_select(outside, away, face);
    return (struct vec){v_copysign(g.x, p.x), v_copysign(g.y, p.y), v_copysign(g.z, p.z)};
}

static struct vec torus_gradient(struct vec p, const struct placed *s) {
    COUNT(torus_gradient, call);
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat outward = v_splat(1.0f) - v_splat(s->a) / v_max(radius, v_splat(1e-30f));
    return (struct vec){p.x * outward, p.y, p.z * outward};
}

static struct vec cone_gradient(struct vec p, const struct placed *s) {
    COUNT(cone_gradient, call);
    vfloat zero = v_splat(0.0f);
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat x = radius - v_splat(s->b), y = p.y - v_splat(s->c);
    vfloat rim = v_select(v_cmp_lt(p.y, zero), v_splat(s->a), v_splat(s->b));
    vfloat cap_x = v_max(radius - rim, zero), cap_y = v_abs(p.y) - v_splat(s->c);
    vfloat across =
        v_madd(x, v_splat(s->slope[0]), y * v_splat(s->slope[1])) * v_splat(-s->per_slope_sq);
    vfloat along = v_min(v_max(across, zero), v_splat(1.0f));
    vfloat side_x = v_madd(v_splat(s->slope[0]), along, x);
    vfloat side_y = v_madd(v_splat(s->slope[1]), along, y);
    // Beside the slope its own normal: the vector to it is all rounding when the point is on it.
    vmask beside = v_and(v_cmp_gt(across, zero), v_cmp_lt(across, v_splat(1.0f)));
    vfloat out = v_select(beside, v_splat(s->slope[1]), side_x),
           up = v_select(beside, v_splat(-s->slope[0]), side_y);
    vmask cap =
        v_cmp_lt(v_madd(cap_x, cap_x, cap_y * cap_y), v_madd(side_x, side_x, side_y * side_y));
    vfloat cap_up =
        v_select(v_cmp_gt(cap_x, zero), cap_y, v_splat(1.0f)); // over the cap: straight up
    out = v_select(cap, cap_x, out);
    up = v_select(cap, v_copysign(cap_up, p.y), up);
    vfloat per_radius = out / v_max(radius, v_splat(1e-30f));
    return (struct vec){p.x * per_radius, up, p.z * per_radius};
}

static struct vec octahedron_gradient(struct vec p) {
    COUNT(octahedron_gradient, call);
    vfloat one = v_splat(1.0f);
    return (struct vec){v_copysign(one, p.x), v_copysign(one, p.y), v_copysign(one, p.z)};
}

// The hit in the frame of one shape, and moved there by `step` along an axis of the world (a column
// of the shape's matrix); axis −1: not moved.
static struct vec moved_in(const struct placed *placed, const struct approach *approach, float step,
                           int axis) {
    COUNT(moved_in, call);
    struct vec p = approach->origin;
    if (axis < 0)
        return p;
    COUNT(moved_in, moved);
    COUNT(moved_in, scalar);
    p = (struct vec){p.x + v_splat(step * placed->turn[0][axis]),
                     p.y + v_splat(step * placed->turn[1][axis]),
                     p.z + v_splat(step * placed->turn[2][axis])};
    return placed->repeated ? vec_wrapped(placed, p) : p;
}

static vfloat moved_power(const struct placed *placed, const struct approach *approach, float step,
                          int axis) {
    if (axis < 0)
        return approach->power;
    COUNT(moved_power, moved);
    struct vec column = {v_splat(placed->turn[0][axis]), v_splat(placed->turn[1][axis]),
                         v_splat(placed->turn[2][axis])};
    return v_madd(v_splat(step),
                  v_madd(v_splat(2.0f), vec_dot(approach->origin, column), v_splat(step)),
                  approach->power);
}

static vfloat moved_distance(const struct placed *placed, const struct approach *approach,
                             vmask live, float step, int axis) {
    COUNT(moved_distance, call);
    if (placed->way == POWER)
        return sdf_power(moved_power(placed, approach, step, axis), placed);
    if (placed->way == LINEAR) {
        if (axis < 0)
            return approach->origin.x;
        COUNT(moved_distance, moved);
        return v_madd(v_splat(placed->normal[axis]), v_splat(step), approach->origin.x);
    }
    return distance_at(moved_in(placed, approach, step, axis), placed, placed->type, live);
}

static struct vec difference(const struct placed *placed, const struct approach *approach,
                             vmask live, float step) {
    COUNT(difference, call);
    vfloat f[4];
    for (int axis = -1; axis < 3; axis++)
        f[axis + 1] = moved_distance(placed, approach, live, step, axis);
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}

// Of the whole scene, as in the other phases.
static struct vec scene_difference(vmask live, float step, const struct prepared *scene,
                                   const struct beam *beam) {
    ACTIVE(v_count(live));
    COUNT(scene_difference, call);
    vfloat f[4];
    for (int axis = -1; axis < 3; axis++) {
        f[axis + 1] = v_splat(INFINITY);
        for (int place = 0; place < beam->list.count; place++) {
            COUNT(scene_difference, shape);
            int i = beam->list.shape[place];
            f[axis + 1] =
                v_min(moved_distance(&scene->placed[i], &beam->approach[i], live, step, axis),
                      f[axis + 1]);
        }
    }
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}

// Which shapes a ray from there need not ask for yet is known then, too.
struct nearness near_hit(vmask found, const struct prepared *scene, struct beam *beam) {
    COUNT(near_hit, call);
    COUNT(near_hit, scalar);
    vfloat least = v_splat(INFINITY), second = least, shape = v_splat(-1.0f);
    for (int place = 0; place < beam->list.count; place++) {
        int i = beam->list.shape[place];
        COUNT(near_hit, shape);
        const struct placed *placed = &scene->placed[i];
        vfloat distance = moved_distance(placed, &beam->approach[i], found, 0, -1);
        shape = v_select(v_cmp_lt(distance, least), v_splat(placed->index),
                         shape); // the first of equals
        second = v_min(second, v_max(distance, least));
        least = v_min(distance, least);
        if (placed->steady) {
            COUNT(near_hit, steady);
            beam->wake[i * GROUP] = wakes_within(distance, placed);
            beam->high = v_min(distance, beam->high);
        }
    }
    beam->high = beam->high + v_splat(1e-30f); // at distance 0 the shape is awake
    float step = (float)scene->model.march.normal_step;
    return (struct nearness){least, v_select(found, shape, v_splat(-1.0f)),
                             v_and(found, v_cmp_lt(second, least + v_splat(2.0f * step)))};
}

// `contact`: hits near another shape, whose difference is the scene's.
static struct vec gradient_of(int shape, vmask found, vmask contact, float step,
                              const struct prepared *scene, const struct beam *beam) {
    ACTIVE(v_count(found));
    COUNT(gradient_of, call);
    const struct placed *placed = &scene->placed[shape];
    const struct approach *approach = &beam->approach[shape];
    vmask near = v_and(found, contact);
    struct vec p = moved_in(placed, approach, 0, -1);
    if (placed->way == LINEAR) // it has a height alone
        p.y = p.z = v_splat(0.0f);
    struct vec exact = p, rounded = p;
    if (placed->way != LINEAR && v_any(v_andnot(contact, found)))
        rounded = difference(placed, approach, found, step);
    if (v_any(near))
        rounded = vec_select(near, scene_difference(near, step, scene, beam), rounded);
    ACTIVE(v_count(found)); // what was called has set its own
    switch (placed->type) {
    case SHAPE_SPHERE: break;
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX: exact = box_gradient(p, placed); break;
    case SHAPE_TORUS: exact = torus_gradient(p, placed); break;
    case SHAPE_CONE: exact = cone_gradient(p, placed); break;
    case SHAPE_OCTAHEDRON: exact = octahedron_gradient(p); break;
    case SHAPE_PLANE: exact = vec_set(placed->size); break;
    default: return rounded;
    }
    COUNT(gradient_of, closed);
    COUNT(gradient_of, scalar);
    exact = turned_back(placed, exact);
    exact = vec_scale(exact, v_splat(1.0f) / vec_norm(exact));
    rounded = vec_scale(rounded, v_splat(1.0f / step));
    struct vec apart = vec_along(rounded, exact, v_splat(-1.0f));
    vfloat size = v_max(v_abs(p.x), v_max(v_abs(p.y), v_abs(p.z)));
    vfloat noise =
        v_madd(size, v_splat(0x1p-20f / step), v_splat(1e-3f)); // 16 half ulps, and curvature
    vmask edge =
        v_and(v_cmp_gt(vec_dot(apart, apart), noise * noise), v_cmp_lt(noise, v_splat(0.5f)));
    if (placed->way == LINEAR) // its own difference is the closed form
        edge = v_and(edge, near);
    return vec_select(edge, rounded, exact);
}

// Towards the side the ray comes from. Once for each shape that the packet hit. `slope`: how fast the
// distance falls along the ray, by a closed form, which is of unit length; 1e30 where there is a
// difference instead, which at an edge or through a thin plate is no slope to divide by. `smooth`: there it is not, and
// the normal points out of the shape.
struct vec normal_at(struct vec direction, vmask found, const struct nearness *near,
                     const struct prepared *scene, const struct beam *beam, vfloat *slope,
                     vmask *smooth) {
    COUNT(normal_at, call);
    float id[LANES], step = (float)scene->model.march.normal_step;
    v_store(near->shape, id);
    struct vec gradient = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (unsigned rest = v_mask_bits(found); rest;) {
        ACTIVE(v_count(found));
        COUNT(normal_at, shape);
        int i = (int)id[__builtin_ctz(rest)];
        vmask same = v_and(found, v_cmp_ge(v_splat(0.5f), v_abs(near->shape - v_splat((float)i))));
        gradient =
            vec_select(same, gradient_of(i, same, near->contact, step, scene, beam), gradient);
        rest &= ~v_mask_bits(same);
    }
    ACTIVE(v_count(found));
    vfloat length = vec_norm(gradient);
    vfloat along = vec_dot(direction, gradient);
    *slope = v_select(v_cmp_lt(v_abs(length - v_splat(1.0f)), v_splat(1e-4f)), v_abs(along),
                      v_splat(1e30f));
    vmask away = v_cmp_gt(along, v_splat(0.0f));
    *smooth = v_andnot(v_or(away, near->contact), v_and(found, v_cmp_lt(*slope, v_splat(2.0f))));
    struct vec n = vec_scale(gradient, v_negate_where(away, v_splat(1.0f) / length));
    // No direction, as at a centre: towards the ray. 1e-18: its square is still a normal float.
    vmask clear = v_and(v_cmp_gt(length, v_splat(1e-18f)), v_cmp_lt(length, v_splat(1e18f)));
    n = vec_select(clear, n, vec_scale(direction, v_splat(-1.0f)));
    return (struct vec){v_select_or_zero(found, n.x), v_select_or_zero(found, n.y),
                        v_select_or_zero(found, n.z)};
}

static struct vec from_to(struct point from, const double to[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(to[i], &hi[i], &lo[i]);
    return vec_scale(point_sub(from, hi, lo), v_splat(-1.0f));
}

static struct lighting light_from(struct point p, struct vec n, vmask found,
                                  const struct view *view) {
    COUNT(light_from, call);
    COUNT(light_from, scalar);
    vfloat zero = v_splat(0.0f);
    struct vec to_light = from_to(p, view->light_position);
    vfloat distance = vec_norm(to_light);
    to_light = vec_scale(to_light, v_splat(1.0f) / distance);
    vfloat facing = vec_dot(n, to_light);
    // Turned away: both terms are zero whatever the shadow. No direction to a light on the surface.
    vmask lit = v_and(found, v_and(v_cmp_gt(facing, zero), v_cmp_gt(distance, zero)));
    return (struct lighting){to_light, distance, facing, lit};
}

// What the light brings to the pixel where nothing is in its way.
static struct vec light_at(struct vec n, struct vec direction, const struct lighting *light,
                           vfloat weight, const struct surface *surface, const struct view *view) {
    ACTIVE(v_count(light->lit));
    COUNT(light_at, call);
    struct vec base = surface->color;
    vfloat reach = weight / light->distance, facing = light->facing;
    // Of the light's direction: minus the paper's R.
    vfloat shine = vec_dot(vec_reflect(light->to_light, n), direction);
    vfloat specular = v_splat(0.0f);
    vmask shines = v_and(light->lit, v_cmp_gt(shine, surface->shine_from));
    if (v_any(shines)) {
        ACTIVE(v_count(shines));
        COUNT(light_at, shines);
        specular = v_select_or_zero(
            shines, v_splat(0.2f) * v_pow(v_max(shine, v_splat(1e-30f)), surface->shininess));
    }
    ACTIVE(v_count(light->lit));
    const double *e = view->light_emission;
    return (struct vec){v_splat((float)e[0]) * v_madd(base.x, facing, specular) * reach,
                        v_splat((float)e[1]) * v_madd(base.y, facing, specular) * reach,
                        v_splat((float)e[2]) * v_madd(base.z, facing, specular) * reach};
}

static void queue_shadow(vmask m, const struct hit *hit, const struct lighting *light,
                         struct vec bright, vfloat pixel, struct desk *desk) {
    int at = desk->shadows;
    float (*field)[ROOM] = desk->shadow;
    pack_vec(m, hit->point.hi, field + S_HI, at);
    pack_vec(m, hit->point.lo, field + S_LO, at);
    pack_vec(m, light->to_light, field + S_TO_LIGHT, at);
    v_compress_store(m, light->distance, &field[S_DISTANCE][at]);
    pack_vec(m, bright, field + S_LIGHT, at);
    v_compress_store(m, pixel, &field[S_PIXEL][at]);
    desk->shadows += __builtin_popcount(v_mask_bits(m));
}

static void queue_mirror(vmask m, const struct hit *hit, struct vec direction, vfloat weight,
                         vfloat share, vfloat pixel, vfloat bounce, const struct world *world) {
    ACTIVE(v_count(m));
    COUNT(queue_mirror, call);
    struct desk *desk = world->desk;
    int at = desk->mirrors;
    float (*field)[ROOM] = desk->mirror;
    vfloat offset = v_splat((float)world->scene->model.march.surface_offset);
    struct point from = point_at(hit->point, hit->normal, offset, v_splat(0.0f));
    pack_vec(m, from.hi, field + M_HI, at);
    pack_vec(m, from.lo, field + M_LO, at);
    pack_vec(m, vec_reflect(direction, hit->normal), field + M_DIRECTION, at);
    v_compress_store(m, weight * share, &field[M_WEIGHT][at]);
    v_compress_store(m, pixel, &field[M_PIXEL][at]);
    v_compress_store(m, bounce + v_splat(1.0f), &field[M_BOUNCE][at]);
    desk->mirrors += __builtin_popcount(v_mask_bits(m));
}

// Of cleared rays: their own shape's terms, where it rises slowly.
static struct vec grazed(struct vec bright, vmask clear, const struct hit *hit,
                         const struct lighting *light, const struct beam *beam,
                         const struct prepared *scene) {
    float id[LANES];
    v_store(hit->shape, id);
    COUNT(grazed, call);
    vmask grazes = v_cmp_lt_in(clear, light->facing, v_splat(scene->lit_slope));
    for (unsigned rest = v_mask_bits(grazes); rest;) {
        ACTIVE(v_count(grazes));
        COUNT(grazed, shape);
        int i = (int)id[__builtin_ctz(rest)];
        vmask same = v_and(grazes, same_shape(hit->shape, i));
        rest &= ~v_mask_bits(same);
        vfloat lit = own_shadow(&scene->placed[i], beam->approach[i].origin, hit->normal, light,
                                &scene->model);
        bright = vec_select(same, vec_scale(bright, lit), bright);
    }
    return bright;
}

// The light on a packet's hits: what is told at once is added, what is not waits.
static struct vec lit_color(struct vec color, struct vec bright, const struct hit *hit,
                            const struct lighting *light, vfloat pixel, const struct beam *beam,
                            struct world *world) {
    const struct prepared *scene = world->scene;
    bool soft = scene->model.shadows == SHADOWS_SOFT;
    vmask open = light->lit;
    if (scene->model.shadows != SHADOWS_NONE) {
        open = scene->told ? cleared(hit, light, beam, world) : v_mask_none();
        vmask asked = v_andnot(open, light->lit);
        if (v_any(asked))
            queue_shadow(asked, hit, light, bright, pixel, world->desk);
        if (soft && v_any(open))
            bright = grazed(bright, open, hit, light, beam, scene);
    }
    ACTIVE(v_count(open));
    COUNT(lit_color, call);
    return (struct vec){v_add_where(open, color.x, bright.x), v_add_where(open, color.y, bright.y),
                        v_add_where(open, color.z, bright.z)};
}

// A packet's hits, whose lighting is known.
static struct vec color_of(const struct rays *rays, int k, const struct hit *hit,
                           const struct lighting *light, const struct beam *beam,
                           struct world *world) {
    const struct model *model = &world->scene->model;
    ACTIVE(v_count(rays->active[k]));
    COUNT(color_of, call);
    const double *b = model->background;
    struct vec background = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    struct vec color = vec_scale(background, rays->weight[k]);
    if (!v_any(hit->found))
        return color;
    ACTIVE(v_count(hit->found));
    COUNT(color_of, found);
    vfloat weight = rays->weight[k];
    struct surface surface = surface_of(hit, world->scene);
    if (model->features.fog) {
        COUNT(color_of, fog);
        struct vec p = hit->point.hi;
        vfloat far_sq = vec_dot(p, p);
        weight = weight * v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq));
    }
    color =
        vec_select(hit->found, vec_scale(surface.color, weight * v_splat(0.01f)), color); // ambient
    if (v_any(light->lit)) {
        struct vec bright =
            light_at(hit->normal, rays->direction[k], light, weight, &surface, world->view);
        color = lit_color(color, bright, hit, light, rays->pixel[k], beam, world);
    }
    if (model->features.mirrors) {
        ACTIVE(v_count(hit->found));
        COUNT(color_of, mirror);
        vmask on = v_cmp_lt(rays->bounce[k], v_splat((float)model->march.max_bounces));
        vmask mirror = v_and(hit->found, v_and(on, v_cmp_gt(surface.share, v_splat(0.0f))));
        if (v_any(mirror))
            queue_mirror(mirror, hit, rays->direction[k], weight, surface.share, rays->pixel[k],
                         rays->bounce[k], world);
    }
    return color;
}

void trace(const struct rays *rays, struct world *world, struct vec color[GROUP],
           struct hit hit[GROUP]) {
    COUNT(trace, call);
    if (world->desk->shadows > QUEUE - TOGETHER) {
        struct list list = world->group.beam[0].list;
        cast_shadows(world);
        for (int k = 0; k < GROUP; k++)
            world->group.beam[k].list = list;
    }
    struct lighting light[GROUP];
    vmask lit = v_mask_none();
    ray_march(rays, world, hit);
    for (int k = 0; k < GROUP; k++) {
        ACTIVE(v_count(hit[k].found));
        light[k].lit = v_mask_none();
        if (v_any(hit[k].found))
            light[k] = light_from(hit[k].point, hit[k].normal, hit[k].found, world->view);
        lit = v_or(lit, light[k].lit);
    }
    if (v_any(lit) && world->scene->model.shadows != SHADOWS_NONE)
        choose_shading(hit, light, world);
    for (int k = 0; k < GROUP; k++)
        if (v_any(rays->active[k]))
            color[k] = color_of(rays, k, &hit[k], &light[k], &world->group.beam[k], world);
}

// The last of the rays that wait first: what they see may make more of them.
void follow_mirrors(struct world *world) {
    COUNT(follow_mirrors, call);
    struct desk *desk = world->desk;
    float (*field)[ROOM] = desk->mirror;
    while (desk->mirrors > 0) {
        int count = desk->mirrors < TOGETHER ? desk->mirrors : TOGETHER;
        int first = desk->mirrors -= count;
        struct rays rays = {.start = v_splat(0.0f), .marched = -1};
        for (int k = 0; k < GROUP; k++, first += LANES, count -= LANES) {
            rays.origin[k] =
                (struct point){load_vec(field + M_HI, first), load_vec(field + M_LO, first)};
            rays.direction[k] = load_vec(field + M_DIRECTION, first);
            COUNT(follow_mirrors, packet);
            rays.active[k] = lanes_before(count);
            rays.weight[k] = v_load(&field[M_WEIGHT][first]);
            rays.pixel[k] = v_load(&field[M_PIXEL][first]);
            rays.bounce[k] = v_load(&field[M_BOUNCE][first]);
        }
        meet(&rays, NULL, HIT, world, world->own->mirror);
        struct vec color[GROUP];
        struct hit hit[GROUP];
        trace(&rays, world, color, hit);
        for (int k = 0; k < GROUP; k++)
            if (v_any(rays.active[k]))
                add_light(rays.active[k], color[k], rays.pixel[k], desk);
    }
}
