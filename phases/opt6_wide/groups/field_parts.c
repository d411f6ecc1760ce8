// Gradients and materials of groups: each part of a field is mixed by the weights of the children that make it.
#include "groups/field.h"
#include "shading/gradients.h"

// Returns the gradient of an octahedron's distance, of any length: p less the nearest point of the face, which is at
// max(|p| − τ, 0) with coordinates that add up to the radius (M. Held, P. Wolfe, H. Crowder, Mathematical Programming 6,
// 1974). Where none of them is 0, and inside, the face's normal.
static struct vec octahedron_way(struct vec p, const struct primitive *s) {
    vfloat x = v_abs(p.x), y = v_abs(p.y), z = v_abs(p.z), one = v_splat(1.0f);
    vfloat least = v_min(x, v_min(y, z)), most = v_max(x, v_max(y, z));
    vfloat over = x + y + z - v_splat(s->a), third = over * v_splat(1.0f / 3.0f);
    vfloat tau = v_max(v_max(third, v_splat(0.5f) * (over - least)), most - v_splat(s->a));
    vmask edge = v_cmp_lt(least, third);
    return (struct vec){v_copysign(v_select(edge, v_min(x, tau), one), p.x),
                        v_copysign(v_select(edge, v_min(y, tau), one), p.y),
                        v_copysign(v_select(edge, v_min(z, tau), one), p.z)};
}

// Returns the gradient of a shape's distance at p, in the shape's frame.
static struct vec gradient_in_frame(struct vec p, const struct primitive *s) {
    struct vec g = gradient_in_axes(p, s), sines, cosines;
    switch ((int)s->type) {
    case SHAPE_OCTAHEDRON: g = octahedron_way(p, s); break;
    case SHAPE_CAPSULE: g.y = p.y - v_min(v_max(p.y, v_splat(-s->c)), v_splat(s->c)); break;
    case SHAPE_ELLIPSOID: {
        struct vec unit = per_radius(p, s);
        vfloat norm = v_max(vec_norm(unit), v_splat(1e-18f));
        return vec_scale(per_radius(unit, s), v_splat(s->a) / norm);
    }
    case SHAPE_GYROID: {
        sines_of(p, s->a, &sines, &cosines);
        vfloat slope = v_copysign(v_splat(s->a * s->b), gyroid_wave(sines, cosines));
        g = (struct vec){v_msub(cosines.x, cosines.y, sines.z * sines.x),
                         v_msub(cosines.y, cosines.z, sines.x * sines.y),
                         v_msub(cosines.z, cosines.x, sines.y * sines.z)};
        return vec_scale(g, slope);
    }
    default: break;
    }
    return vec_scale(g, v_splat(1.0f) / v_max(vec_norm(g), v_splat(1e-18f)));
}

__attribute__((noinline)) static struct field_part
shape_part(const struct step *step, const struct group_node *n, const struct vec *p) {
    const struct primitive *s = &n->shape;
    vfloat f;
    shape_distances(step, n, p, 1, &f);
    struct vec g = gradient_in_frame(step->first ? *p : in_frame(*p, s), s);
    return (struct field_part){f, step->first ? g : turned_back(s, g), vec_set(n->color),
                               v_splat(n->reflectivity), v_splat(n->shininess)};
}

// Adds a part times its weight. Distances are not mixed.
static void add_part(struct field_part *to, const struct field_part *part, vfloat w, vfloat sign) {
    to->gradient = vec_along(to->gradient, part->gradient, w * sign);
    to->color = vec_along(to->color, part->color, w);
    to->reflectivity = v_madd(part->reflectivity, w, to->reflectivity);
    to->shininess = v_madd(part->shininess, w, to->shininess);
}

// Returns the parts of a fold. A sharp one has the parts of the child that decides, the first of equals.
static struct field_part folded_part(const struct step *step, const struct group_node *n,
                                     const struct field_part *part) {
    int count = step->count;
    vfloat d[count], copy[count], zero = v_splat(0.0f), one = v_splat(1.0f), level = one;
    vfloat out = v_splat(n->operation == NODE_UNION ? 1.0f : -1.0f);
    struct field_part all = {zero, {zero, zero, zero}, {zero, zero, zero}, zero, zero};
    vmask free = v_mask_all();
    for (int i = 0; i < count; i++)
        copy[i] = d[i] = part[i].f;
    all.f = folded_distance(step, n, 1, copy);
    for (int i = 0; i < count; i++)
        d[i] = negated_if(is_negated(step, n, i), d[i]);
    bool blends = n->blend > 0 && count > 1;
    if (blends)
        level_of(count, 1, d, n->per_blend, &level);
    for (int i = 0; i < count; i++) {
        vmask here = v_and(free, v_cmp_le(d[i], out * all.f));
        vfloat w = blends ? weight_of(d[i], level) : v_select_or_zero(here, one);
        add_part(&all, &part[i], w, negated_if(is_negated(step, n, i), out));
        free = v_andnot(here, free);
    }
    return all;
}

// Takes a gradient to points outside of the twist's cylinder: they see the field f of its nearest point, or the way to it.
static struct vec outside_twist(struct vec g, struct vec q, vfloat f, const struct group_node *n) {
    vfloat off = v_sqrt(v_madd(q.x, q.x, q.z * q.z)), most = v_splat(n->twist_radius);
    vfloat per = v_splat(1.0f) / v_max(off, v_splat(1e-18f)), zero = v_splat(0.0f);
    struct vec out = {q.x * per, zero, q.z * per};
    vfloat across = v_madd(out.x, g.x, out.z * g.z), scale = most * per;
    struct vec near = {v_nmadd(out.x, across, g.x) * scale, g.y,
                       v_nmadd(out.z, across, g.z) * scale};
    near = vec_select(v_cmp_gt(off - v_splat(n->twist_inner), f), out, near);
    return vec_select(v_cmp_gt(off, most), near, g);
}

// Takes a gradient from a node's frame, twisted, to its parent's. f: the field before the displacement; inside: after.
static struct vec gradient_left(struct vec g, struct node_point at, struct vec p, vfloat f,
                                vfloat inside, const struct group_node *n) {
    if (n->twist != 0) {
        vfloat angle = v_splat(n->twist) * at.q.y, s = v_sin(angle), c = v_cos(angle);
        vfloat turning = v_msub(g.z, at.r.x, g.x * at.r.z);
        g = (struct vec){v_madd(c, g.x, s * g.z), v_madd(v_splat(n->twist), turning, g.y),
                         v_msub(c, g.z, s * g.x)};
        g = outside_twist(g, at.q, f, n);
    }
    if (n->amplitude > 0) {
        struct vec w = waves(at.q, n);
        const float *by = n->frequency;
        g.x =
            v_madd(v_splat(n->amplitude * by[0]) * v_cos(v_splat(by[0]) * at.q.x), w.y * w.z, g.x);
        g.y =
            v_madd(v_splat(n->amplitude * by[1]) * v_cos(v_splat(by[1]) * at.q.y), w.z * w.x, g.y);
        g.z =
            v_madd(v_splat(n->amplitude * by[2]) * v_cos(v_splat(by[2]) * at.q.z), w.x * w.y, g.z);
    }
    if (n->shell > 0)
        g = vec_scale(g, v_copysign(v_splat(1.0f), inside));
    if (n->moved)
        p = in_frame(p, &n->shape);
    vmask flip[3] = {v_signbit(p.x), v_signbit(p.y), v_signbit(p.z)};
    g.x = n->mirror[0] ? v_negate_where(flip[0], g.x) : g.x;
    g.y = n->mirror[1] ? v_negate_where(flip[1], g.y) : g.y;
    g.z = n->mirror[2] ? v_negate_where(flip[2], g.z) : g.z;
    return turned_back(&n->shape, g);
}

__attribute__((noinline)) static void leave_part(const struct group_node *n, const struct vec *p,
                                                 struct field_part *part) {
    struct node_point at = point_in(*p, n);
    vfloat inside = displaced(part->f, at, n); // which side of a shell is it?
    part->gradient = gradient_left(part->gradient, at, *p, part->f, inside, n);
    part->f = shelled(inside, n);
}

struct field_part field_parts(const struct program *program, struct vec at) {
    struct field_part stack[program->values], *top = stack;
    struct vec points[program->points + 1], *p = points;
    points[0] = at;
    for (int i = 0; i < program->length; i++) {
        const struct step *step = &program->steps[i];
        const struct group_node *n = &program->nodes[step->node];
        switch (step->kind) {
        case STEP_SHAPE: *top++ = shape_part(step, n, p); break;
        case STEP_ENTER:
            enter_node(n, p, p + 1);
            p++;
            break;
        case STEP_FOLD: {
            top -= step->count;
            struct field_part all = folded_part(step, n, top);
            *top++ = all;
            break;
        }
        case STEP_LEAVE: leave_part(n, --p, top - 1); break;
        default: break;
        }
    }
    stack->f = stack->f * v_splat(program->scale);
    stack->gradient = vec_scale(stack->gradient, v_splat(program->scale));
    return *stack;
}
