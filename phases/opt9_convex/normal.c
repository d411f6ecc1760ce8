// Normals of hits that were marched to: by gradients in closed form, or by differences of distances.
#include "trace.h"

// Normals. The scene asks for forward differences of its distance over normal_step; in float they
// are noise in the third digit (an ulp of the point over 1e-4). So the gradient of the shape that
// was hit, in closed form, stands where the two agree to that noise. Where they do not, within a
// step of an edge, the shape's difference stands; and where another shape is within reach of the
// step, as where two touch, the difference of the whole scene. The Mandelbulb has only differences.
// Gradients are in the world's axes in the end, and need not be of unit length.
static struct vec box_gradient(struct vec p, const struct placed *s) {
    COUNT(box_gradient, call);
    real zero = set(0.0f);
    real x = absolute(p.x) - set(s->size[0]);
    real y = absolute(p.y) - set(s->size[1]);
    real z = absolute(p.z) - set(s->size[2]);
    real most = most_of(x, most_of(y, z));
    // Outside: away from the nearest point. Inside: along the axis of the nearest face.
    mask outside = greater(most, zero), on_x = not_less(x, most), on_y = not_less(y, most);
    real one = set(1.0f);
    struct vec face = {keep(on_x, one), keep(but_not(on_x, on_y), one),
                       drop(either(on_x, on_y), one)};
    struct vec away = {most_of(x, zero), most_of(y, zero), most_of(z, zero)};
    struct vec g = vec_choose(outside, away, face);
    return (struct vec){with_sign_of(p.x, g.x), with_sign_of(p.y, g.y), with_sign_of(p.z, g.z)};
}

static struct vec torus_gradient(struct vec p, const struct placed *s) {
    COUNT(torus_gradient, call);
    real radius = root(mul_add(p.x, p.x, p.z * p.z));
    real outward = set(1.0f) - set(s->a) / most_of(radius, set(1e-30f));
    return (struct vec){p.x * outward, p.y, p.z * outward};
}

static struct vec cone_gradient(struct vec p, const struct placed *s) {
    COUNT(cone_gradient, call);
    real zero = set(0.0f);
    real radius = root(mul_add(p.x, p.x, p.z * p.z));
    real x = radius - set(s->b), y = p.y - set(s->c);
    real rim = choose(less(p.y, zero), set(s->a), set(s->b));
    real cap_x = most_of(radius - rim, zero), cap_y = absolute(p.y) - set(s->c);
    real across = mul_add(x, set(s->slope[0]), y * set(s->slope[1])) * set(-s->per_slope_sq);
    real along = least_of(most_of(across, zero), set(1.0f));
    real side_x = mul_add(set(s->slope[0]), along, x);
    real side_y = mul_add(set(s->slope[1]), along, y);
    // Beside the slope its own normal: the vector to it is all rounding when the point is on it.
    mask beside = both(greater(across, zero), less(across, set(1.0f)));
    real out = choose(beside, set(s->slope[1]), side_x),
         up = choose(beside, set(-s->slope[0]), side_y);
    mask cap = less(mul_add(cap_x, cap_x, cap_y * cap_y), mul_add(side_x, side_x, side_y * side_y));
    real cap_up = choose(greater(cap_x, zero), cap_y, set(1.0f)); // over the cap: straight up
    out = choose(cap, cap_x, out);
    up = choose(cap, with_sign_of(p.y, cap_up), up);
    real per_radius = out / most_of(radius, set(1e-30f));
    return (struct vec){p.x * per_radius, up, p.z * per_radius};
}

static struct vec octahedron_gradient(struct vec p) {
    COUNT(octahedron_gradient, call);
    real one = set(1.0f);
    return (struct vec){with_sign_of(p.x, one), with_sign_of(p.y, one), with_sign_of(p.z, one)};
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
    p = (struct vec){p.x + set(step * placed->turn[0][axis]),
                     p.y + set(step * placed->turn[1][axis]),
                     p.z + set(step * placed->turn[2][axis])};
    return placed->repeated ? vec_wrapped(placed, p) : p;
}

static real moved_power(const struct placed *placed, const struct approach *approach, float step,
                        int axis) {
    if (axis < 0)
        return approach->power;
    COUNT(moved_power, moved);
    struct vec column = {set(placed->turn[0][axis]), set(placed->turn[1][axis]),
                         set(placed->turn[2][axis])};
    return mul_add(set(step), mul_add(set(2.0f), vec_dot(approach->origin, column), set(step)),
                   approach->power);
}

static real moved_distance(const struct placed *placed, const struct approach *approach, mask done,
                           float step, int axis) {
    COUNT(moved_distance, call);
    if (placed->way == POWER)
        return sdf_power(moved_power(placed, approach, step, axis), placed);
    if (placed->way == LINEAR) {
        if (axis < 0)
            return approach->origin.x;
        COUNT(moved_distance, moved);
        return mul_add(set(placed->normal[axis]), set(step), approach->origin.x);
    }
    return distance_at(moved_in(placed, approach, step, axis), placed, done);
}

static struct vec difference(const struct placed *placed, const struct approach *approach,
                             mask done, float step) {
    COUNT(difference, call);
    real f[4];
    for (int axis = -1; axis < 3; axis++)
        f[axis + 1] = moved_distance(placed, approach, done, step, axis);
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}

// Of the whole scene, as in the other phases.
static struct vec scene_difference(mask done, float step, const struct world *world) {
    ACTIVE(LANES - count_of(done));
    COUNT(scene_difference, call);
    real f[4];
    for (int axis = -1; axis < 3; axis++) {
        f[axis + 1] = set(INFINITY);
        for (int i = 0; i < world->scene->model.shape_count; i++) {
            COUNT(scene_difference, shape);
            f[axis + 1] = least_of(
                moved_distance(&world->scene->placed[i], &world->approach[i], done, step, axis),
                f[axis + 1]);
        }
    }
    return (struct vec){f[1] - f[0], f[2] - f[0], f[3] - f[0]};
}

struct nearness near_hit(mask found, const struct world *world) {
    COUNT(near_hit, call);
    COUNT(near_hit, scalar);
    const struct prepared *scene = world->scene;
    real least = set(INFINITY), second = least, shape = set(-1.0f);
    for (int i = 0; i < scene->model.shape_count; i++) {
        COUNT(near_hit, shape);
        const struct placed *placed = &scene->placed[i];
        real distance = moved_distance(placed, &world->approach[i], not_in(found), 0, -1);
        shape = choose(less(distance, least), set(placed->index), shape); // the first of equals
        second = least_of(second, most_of(distance, least));
        least = least_of(distance, least);
    }
    float step = (float)scene->model.march.normal_step;
    return (struct nearness){least, choose(found, shape, set(-1.0f)),
                             both(found, less(second, least + set(2.0f * step)))};
}

// `contact`: hits near another shape, whose difference is the scene's.
static struct vec gradient_of(int shape, mask found, mask contact, float step,
                              const struct world *world) {
    ACTIVE(count_of(found));
    COUNT(gradient_of, call);
    const struct placed *placed = &world->scene->placed[shape];
    const struct approach *approach = &world->approach[shape];
    mask near = both(found, contact);
    struct vec p = moved_in(placed, approach, 0, -1);
    if (placed->way == LINEAR) // it has a height alone
        p.y = p.z = set(0.0f);
    struct vec exact = p, rounded = p;
    if (placed->way != LINEAR && any(but_not(contact, found)))
        rounded = difference(placed, approach, not_in(found), step);
    if (any(near))
        rounded = vec_choose(near, scene_difference(not_in(near), step, world), rounded);
    ACTIVE(count_of(found)); // what was called has set its own
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
    exact = vec_scale(exact, set(1.0f) / vec_norm(exact));
    rounded = vec_scale(rounded, set(1.0f / step));
    struct vec apart = vec_along(rounded, exact, set(-1.0f));
    real size = most_of(absolute(p.x), most_of(absolute(p.y), absolute(p.z)));
    real noise = mul_add(size, set(0x1p-20f / step), set(1e-3f)); // 16 half ulps, and curvature
    mask edge = both(greater(vec_dot(apart, apart), noise * noise), less(noise, set(0.5f)));
    if (placed->way == LINEAR) // its own difference is the closed form
        edge = both(edge, near);
    return vec_choose(edge, rounded, exact);
}

// Towards the side the ray comes from. Once for each shape that the packet hit. `slope`: how fast the
// distance falls along the ray, by a closed form, which is of unit length; 1e30 where there is a
// difference instead, which at an edge or through a thin plate is no slope to divide by.
struct vec normal_at(struct vec direction, mask found, const struct nearness *near,
                     const struct world *world, real *slope) {
    COUNT(normal_at, call);
    float id[LANES], step = (float)world->scene->model.march.normal_step;
    unload(near->shape, id);
    struct vec gradient = {set(0.0f), set(0.0f), set(0.0f)};
    for (unsigned rest = bits(found); rest;) {
        ACTIVE(count_of(found));
        COUNT(normal_at, shape);
        int i = (int)id[__builtin_ctz(rest)];
        mask same = both(found, not_less(set(0.5f), absolute(near->shape - set((float)i))));
        gradient = vec_choose(same, gradient_of(i, same, near->contact, step, world), gradient);
        rest &= ~bits(same);
    }
    ACTIVE(count_of(found));
    real length = vec_norm(gradient);
    real along = vec_dot(direction, gradient);
    *slope = choose(less(absolute(length - set(1.0f)), set(1e-4f)), absolute(along), set(1e30f));
    mask away = greater(along, set(0.0f));
    struct vec n = vec_scale(gradient, negate_where(away, set(1.0f) / length));
    // No direction, as at a centre: towards the ray. 1e-18: its square is still a normal float.
    mask clear = both(greater(length, set(1e-18f)), less(length, set(1e18f)));
    n = vec_choose(clear, n, vec_scale(direction, set(-1.0f)));
    return (struct vec){keep(found, n.x), keep(found, n.y), keep(found, n.z)};
}
