// What a hit looks like: normal, light (B. T. Phong, "Illumination for computer generated
// pictures", CACM 18 (1975)), mirror by recursion, fog.
#include "simd/point.h"
#include "simd/pow.h"
#include "tiles.h"

// Materials of hits, gathered.
struct surfaces {
    struct vec color;
    vfloat reflectivity, shininess;
};

static struct surfaces gather(vfloat shape, vmask found, const struct model *model) {
    float id[LANES], values[5][LANES];
    v_store(v_select(found, shape, v_splat(0.0f)), id);
    for (int lane = 0; lane < LANES; lane++) {
        const struct material *m = &model->materials[model->shapes[(int)id[lane]].material];
        for (int i = 0; i < 3; i++)
            values[i][lane] = (float)m->color[i];
        values[3][lane] = (float)m->reflectivity;
        values[4][lane] = (float)m->shininess;
    }
    return (struct surfaces){{v_load(values[0]), v_load(values[1]), v_load(values[2])},
                             v_load(values[3]),
                             v_load(values[4])};
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
            beam->wake[i * beam->apart] = wakes_within(distance, placed);
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
// difference instead, which at an edge or through a thin plate is no slope to divide by.
struct vec normal_at(struct vec direction, vmask found, const struct nearness *near,
                     const struct prepared *scene, const struct beam *beam, vfloat *slope) {
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

static struct vec light_at(struct vec n, struct vec direction, const struct lighting *light,
                           vfloat shadow, const struct surfaces *surface, const struct view *view) {
    COUNT(light_at, call);
    struct vec base = surface->color, color = vec_scale(base, v_splat(0.01f)); // ambient
    if (!v_any(light->lit))
        return color;
    ACTIVE(v_count(light->lit));
    COUNT(light_at, lit);
    vfloat reach = shadow / light->distance, facing = light->facing;
    // Of the light's direction: minus the paper's R.
    vfloat shine = vec_dot(vec_reflect(light->to_light, n), direction);
    vfloat specular = v_splat(0.2f) * v_pow(v_max(shine, v_splat(1e-30f)), surface->shininess);
    specular = v_select_or_zero(v_cmp_gt(shine, v_splat(0.0f)), specular);
    const double *e = view->light_emission;
    struct vec emission = {v_splat((float)e[0]), v_splat((float)e[1]), v_splat((float)e[2])};
    struct vec bright = {v_madd(emission.x * v_madd(base.x, facing, specular), reach, color.x),
                         v_madd(emission.y * v_madd(base.y, facing, specular), reach, color.y),
                         v_madd(emission.z * v_madd(base.z, facing, specular), reach, color.z)};
    return vec_select(light->lit, bright, color);
}

// Colours of what the reflective hits of a few packets mirror, added to theirs. One reflective ray makes the call; the
// others are masked out of it and of their colour.
static void mirror(const struct rays *rays, int bounce, struct world *world,
                   const struct surfaces *surface, struct shaded *result) {
    COUNT(mirror, call);
    struct point origin[FEW];
    struct vec direction[FEW];
    vmask activated[FEW];
    const struct rays mirrored = {origin, direction, activated, v_splat(0.0f)};
    bool one = false;
    for (int k = 0; k < FEW; k++) {
        const struct hit *hit = &result[k].hit;
        ACTIVE(v_count(hit->found));
        COUNT(mirror, packet);
        vmask active = v_and(hit->found, v_cmp_gt(surface[k].reflectivity, v_splat(0.0f)));
        activated[k] = active;
        if (!v_any(active))
            continue;
        one = true;
        ACTIVE(v_count(active));
        COUNT(mirror, start);
        vfloat offset = v_splat((float)world->scene->model.march.surface_offset);
        origin[k] = point_at(hit->point, hit->normal, offset, v_splat(0.0f));
        direction[k] = vec_reflect(rays->direction[k], hit->normal);
    }
    if (!one)
        return;
    group_size(&world->group, FEW);
    meet(&mirrored, NULL, HIT, world, world->own->mirror);
    struct shaded seen[FEW];
    trace(&mirrored, bounce + 1, world, seen);
    for (int k = 0; k < FEW; k++) {
        vmask active = activated[k];
        if (!v_any(active))
            continue;
        ACTIVE(v_count(active));
        COUNT(mirror, seen);
        vfloat share = v_select_or_zero(active, surface[k].reflectivity * v_splat(0.1f));
        struct vec color = result[k].color;
        result[k].color = vec_along(color, vec_select(active, seen[k].color, color), share);
    }
}

// The group's packets seen; the arrays have one for each.
static inline void trace_packets(const struct rays *rays, int bounce, struct world *world,
                                 struct hit *hit, struct lighting *light, struct surfaces *surface,
                                 vfloat *reach, struct shaded *result) {
    COUNT(trace, call);
    const struct model *model = &world->scene->model;
    const double *b = model->background;
    struct vec background = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    const int size = world->group.size;
    ray_march(rays, world, hit);
    for (int k = 0; k < size; k++) {
        ACTIVE(v_count(hit[k].found));
        light[k].lit = v_mask_none();
        surface[k] = (struct surfaces){0};
        if (!v_any(hit[k].found))
            continue;
        surface[k] = gather(hit[k].shape, hit[k].found, model);
        light[k] = light_from(hit[k].point, hit[k].normal, hit[k].found, world->view);
    }
    shadow(hit, light, world, reach);
    for (int k = 0; k < size; k++) {
        ACTIVE(v_count(hit[k].found));
        result[k] = (struct shaded){.color = background, .hit = hit[k]};
        if (v_any(hit[k].found))
            result[k].color = light_at(hit[k].normal, rays->direction[k], &light[k], reach[k],
                                       &surface[k], world->view);
    }
    if (model->features.mirrors && bounce < model->march.max_bounces)
        for (int first = 0; first < size; first += FEW) {
            const struct rays some = {rays->origin + first, rays->direction + first,
                                      rays->active + first, rays->start};
            mirror(&some, bounce, world, surface + first, result + first);
        }
    for (int k = 0; k < size; k++) {
        struct vec color = result[k].color;
        ACTIVE(v_count(hit[k].found));
        if (!v_any(hit[k].found))
            continue;
        if (model->features.fog) {
            COUNT(trace, fog);
            struct vec p = hit[k].point.hi;
            vfloat far_sq = vec_dot(p, p);
            color = vec_scale(color, v_exp(v_splat((float)-model->fog) * far_sq * v_sqrt(far_sq)));
        }
        result[k].color = vec_select(hit[k].found, color, background);
    }
}

// A large group is seen from the camera alone, so that as many bounces as a scene may ask for fit the stack.
__attribute__((noinline)) static void trace_many(const struct rays *rays, int bounce,
                                                 struct world *world, struct shaded *result) {
    struct hit hit[GROUP];
    struct lighting light[GROUP];
    struct surfaces surface[GROUP];
    vfloat reach[GROUP];
    trace_packets(rays, bounce, world, hit, light, surface, reach, result);
}

__attribute__((noinline)) static void trace_few(const struct rays *rays, int bounce,
                                                struct world *world, struct shaded *result) {
    struct hit hit[FEW];
    struct lighting light[FEW];
    struct surfaces surface[FEW];
    vfloat reach[FEW];
    trace_packets(rays, bounce, world, hit, light, surface, reach, result);
}

void trace(const struct rays *rays, int bounce, struct world *world, struct shaded *result) {
    if (world->group.size == FEW)
        trace_few(rays, bounce, world, result);
    else
        trace_many(rays, bounce, world, result);
}
