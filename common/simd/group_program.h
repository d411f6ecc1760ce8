// Groups of shapes, for the points of a packet at once: of doubles in opt3, of floats in opt4. A tree of operations is a
// program in postfix order (scene/group_compile.h): children leave their values on a stack, and an operation folds the last
// of them into one. A node without a frame of its own, a twist or a displacement has no instruction for it.
//
// Included by the phase's group.c: its are vreal, the vectors, apply_transform(), leaf_distance() and struct primitive.
#pragma once

enum { MAX_FRAMES = 2 * (SCENE_MAX_DEPTH + 2), MAX_VALUES = SCENE_MAX_NODES };

static vreal sdf_capsule(struct vec p, const struct primitive *s) {
    COUNT(sdf_capsule, call);
    vreal half = v_splat(s->cone.half_height);
    p.y = p.y - v_min(v_max(p.y, -half), half);
    return vec_norm(p) - v_splat(s->cone.bottom_radius);
}

// A bound: the distance is at least (|p/r| − 1)·min r.
static vreal sdf_ellipsoid(struct vec p, const struct primitive *s) {
    COUNT(sdf_ellipsoid, call);
    struct vec inv = vec_set(s->ellipsoid.inv_radii);
    struct vec q = {p.x * inv.x, p.y * inv.y, p.z * inv.z};
    return (vec_norm(q) - v_splat(1.0f)) * v_splat(s->ellipsoid.least);
}

static vreal sdf_gyroid(struct vec p, const struct primitive *s) {
    COUNT(sdf_gyroid, call);
    struct vec q = vec_scale(p, v_splat(s->gyroid.frequency));
    vreal level = v_madd(sin_of(q.x), cos_of(q.y),
                         v_madd(sin_of(q.y), cos_of(q.z), sin_of(q.z) * cos_of(q.x)));
    return v_msub(v_abs(level), v_splat(s->gyroid.scale), v_splat(s->gyroid.half_thickness));
}

// Returns the distance of a node's shape at points of its parent's frame.
static vreal leaf_distance(struct vec point, const struct primitive *s);

// Children's values with their signs: all operations are minima of them, with the first one's sign.
static vreal signed_value(const struct node *node, const vreal *value, int i) {
    bool positive = i ? node->operation != NODE_INTERSECTION : node->operation == NODE_UNION;
    return positive ? value[i] : -value[i];
}

// The minimum of all values; with blend k > 0 the smooth minimum of all at once: the least Σ wᵢdᵢ + k/2·(Σ wᵢ² − 1)
// of any weights w ≥ 0 of sum 1. There wᵢ = max(τ − eᵢ, 0)/k with eᵢ = dᵢ − least; τ by Michelot's method, until it
// rests in all lanes. (A. F. T. Martins, R. F. Astudillo, "From softmax to sparsemax", ICML 2016.)
static vreal fold(const struct node *node, const vreal *value, vreal *least, vreal *tau) {
    COUNT(fold, call);
    vreal k = *tau = v_splat(node->blend), folded = *least = v_splat(INFINITY);
    for (int i = 0; i < node->children; i++) {
        COUNT(fold, child);
        folded = *least = v_min(signed_value(node, value, i), *least);
    }
    if (node->blend > 0.0) {
        vreal zero = v_splat(0.0f), one = v_splat(1.0f), kept = v_splat(INFINITY), squares, before;
        do { // kept are those below τ, which falls from k
            COUNT(fold, pass);
            vreal sum = squares = zero;
            before = kept;
            kept = zero;
            for (int i = 0; i < node->children; i++) {
                COUNT(fold, tested);
                vreal e = signed_value(node, value, i) - *least;
                vmask below = v_cmp_lt(e, *tau);
                e = v_select_or_zero(below, e);
                kept = kept + v_select_or_zero(below, one);
                sum = sum + e;
                squares = v_madd(e, e, squares);
            }
            *tau = v_min((k + sum) / kept, *tau);
        } while (v_any(v_and(v_cmp_lt(kept, before), v_cmp_gt(kept, one))));
        COUNT(fold, blended);
        folded = v_madd(v_splat(0.5f), v_msub(kept * *tau, *tau, squares) / k - k, *least);
    }
    return node->operation == NODE_UNION ? folded : -folded;
}

// Mixes the children's surfaces into the first one's place by the weights of fold(). A sharp operation takes the
// first child of the least value.
static void fold_surfaces(const struct node *node, const vreal *value, vreal least, vreal tau,
                          struct materials *surface) {
    vreal zero = v_splat(0.0f);
    struct materials mixed = {{zero, zero, zero}, zero, zero};
    vmask decided = v_mask_none();
    for (int i = 0; i < node->children; i++) {
        COUNT(fold_surfaces, child);
        vreal e = signed_value(node, value, i) - least, weight;
        if (node->blend > 0.0) {
            weight = v_max(tau - e, zero) / v_splat(node->blend);
        } else {
            vmask decides = v_andnot(v_or(v_cmp_gt(e, zero), decided), v_not(v_mask_none()));
            weight = v_select_or_zero(decides, v_splat(1.0f));
            decided = v_or(decided, decides);
        }
        mixed.color = vec_along(mixed.color, surface[i].color, weight);
        mixed.reflectivity = v_madd(surface[i].reflectivity, weight, mixed.reflectivity);
        mixed.shininess = v_madd(surface[i].shininess, weight, mixed.shininess);
    }
    surface[0] = mixed;
}

static vreal mirrored(vreal x) {
    COUNT(mirrored, call);
    return v_abs(x);
}

static struct vec to_frame(struct vec point, const struct instruction *in) {
    struct vec p = apply_transform(point, &in->primitive);
    const bool *mirror = in->node->mirror;
    return (struct vec){mirror[0] ? mirrored(p.x) : p.x, mirror[1] ? mirrored(p.y) : p.y,
                        mirror[2] ? mirrored(p.z) : p.z};
}

static struct vec twisted(struct vec p, const struct node *node) {
    COUNT(twisted, call);
    vreal angle = v_splat(node->twist) * p.y, limit = v_splat(node->twist_radius);
    vreal inward = limit / v_max(v_sqrt(v_madd(p.x, p.x, p.z * p.z)), limit);
    vreal c = inward * cos_of(angle), s = inward * sin_of(angle);
    return (struct vec){v_msub(c, p.x, s * p.z), p.y, v_madd(s, p.x, c * p.z)};
}

// The values of a node with the end of its twist, displacement, shell and offset, at the points in its frame.
static vreal modified(const struct node *node, struct vec p, vreal f) {
    COUNT(modified, call);
    if (node->twist != 0.0) {
        COUNT(modified, twisted);
        f = v_max(f, v_sqrt(v_madd(p.x, p.x, p.z * p.z)) - v_splat(node->twist_inner));
    }
    if (node->amplitude > 0.0) {
        COUNT(modified, displaced);
        struct vec w = vec_from_doubles(node->frequency);
        vreal x = sin_of(w.x * p.x), y = sin_of(w.y * p.y), z = sin_of(w.z * p.z);
        f = v_madd(v_splat(node->amplitude) * x, y * z, f);
    }
    if (node->shell > 0.0) {
        COUNT(modified, shell);
        f = v_abs(f) - v_splat(node->shell);
    }
    return f - v_splat(node->offset);
}

static struct materials surface_of(const struct material *m) {
    return (struct materials){vec_from_doubles(m->color), v_splat(m->reflectivity),
                              v_splat(m->shininess)};
}

// Runs the program at points of the group's frame. `surfaces`, unless NULL, gets the materials at its start, and
// has room for one of each value.
static vreal run(struct vec p, const struct primitive *group, const struct material *materials,
                 struct materials *surfaces) {
    struct vec frame[MAX_FRAMES];
    vreal value[MAX_VALUES], least, tau;
    int top = -1;
    frame[0] = p;
    for (int i = 0; i < group->group.length; i++) {
        const struct instruction *in = &group->group.program[i];
        const struct node *node = in->node;
        struct vec *at = &frame[in->frame];
        switch (in->opcode) {
        case TO_FRAME: at[1] = to_frame(*at, in); break;
        case TWIST: at[1] = twisted(*at, node); break;
        case LEAF:
            value[++top] = leaf_distance(*at, &in->primitive);
            if (surfaces)
                surfaces[top] = surface_of(&materials[node->shape.material]);
            break;
        case FOLD: {
            top -= node->children - 1;
            vreal folded = fold(node, value + top, &least, &tau);
            if (surfaces)
                fold_surfaces(node, value + top, least, tau, surfaces + top);
            value[top] = folded;
            break;
        }
        case MODIFY: value[top] = modified(node, *at, value[top]); break;
        }
    }
    return value[0];
}
