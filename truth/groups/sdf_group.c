// Distances of shapes and groups in double-double, for the shadow's estimator and marches; a group's field is as scene.h
// defines it. The smooth minimum by C. Michelot's method (J. Optim. Theory Appl. 50 (1986)).
#include "groups/field.h"
#include "trace.h"

static struct dd capsule(const struct dd p[3], const struct shape *shape) {
    struct dd end = dd_from(shape->capsule.half_height), q[3] = {p[0], p[1], p[2]};
    q[1] = dd_sub(q[1], dd_min(dd_max(q[1], dd_neg(end)), end));
    return dd_sub(dd_norm(q), dd_from(shape->capsule.radius));
}

static struct dd ellipsoid(const struct dd p[3], const struct shape *shape) {
    const double *radius = shape->ellipsoid.radius;
    struct dd q[3];
    for (int i = 0; i < 3; i++)
        q[i] = dd_div(p[i], dd_from(radius[i]));
    double least = fmin(radius[0], fmin(radius[1], radius[2]));
    return dd_scale(dd_sub(dd_norm(q), dd_from(1)), least);
}

static struct dd gyroid(const struct dd p[3], const struct shape *shape) {
    struct dd s[3], c[3], sum = dd_from(0), turn = dd_twofold(DD_PI, 2);
    struct dd cell = dd_from(shape->gyroid.cell);
    for (int i = 0; i < 3; i++) {
        struct dd x = dd_div(dd_mul(turn, p[i]), cell);
        s[i] = dd_sine(x, 0);
        c[i] = dd_sine(x, 1);
    }
    for (int i = 0; i < 3; i++)
        sum = dd_add(sum, dd_mul(s[i], c[(i + 1) % 3]));
    struct dd scale = dd_div(cell, dd_mul(turn, dd_sqrt(dd_from(3))));
    return dd_sub(dd_mul(dd_abs(sum), scale), dd_from(shape->gyroid.thickness / 2));
}

static struct dd smooth_minimum(const struct dd *d, int count, double blend) {
    struct dd least = d[0], k = dd_from(blend), squares = dd_from(0);
    for (int i = 1; i < count; i++)
        least = dd_min(least, d[i]);
    struct dd level = dd_add(least, k);
    for (int before = count + 1, active = 0;; before = active, active = 0) {
        struct dd sum = k;
        for (int i = 0; i < count; i++)
            if (dd_less(d[i], level)) {
                sum = dd_add(sum, dd_sub(d[i], least));
                active++;
            }
        if (active == 0 || active >= before)
            break;
        level = dd_add(least, dd_div(sum, dd_from(active)));
    }
    for (int i = 0; i < count; i++)
        if (dd_less(d[i], level))
            squares = dd_add(squares, dd_sqr(dd_sub(level, d[i])));
    return dd_sub(dd_sub(level, dd_twofold(k, 0.5)), dd_twofold(dd_div(squares, k), 0.5));
}

static struct dd node_at(const struct solid *group, int index, const struct dd p[3]);

// The operation of a node as the least of its children's signed values. What the spheres show to be farther than the
// nearest child is left out.
static struct dd operate(const struct solid *group, int index, const struct dd p[3]) {
    const struct node *nodes = group->nodes, *node = &nodes[index];
    double rough[3] = {p[0].hi, p[1].hi, p[2].hi}, limit = INFINITY, nearest = INFINITY;
    struct dd least = dd_from(INFINITY), kept[node->children];
    int count = 0, start = index + 1;
    for (int i = start; node->operation == NODE_UNION && i < node->end; i = nodes[i].end) {
        double bound = bound_by_sphere(&nodes[i], rough, 0);
        if (bound < nearest) {
            nearest = bound;
            start = i;
        }
    }
    for (int i = start, next = index + 1;;) {
        bool negative = node->operation == NODE_INTERSECTION ||
                        (node->operation == NODE_DIFFERENCE && i == index + 1);
        double bound = negative ? 0 : bound_by_sphere(&nodes[i], rough, 0);
        if (count == 0 || !(bound > 0 && bound > limit)) {
            struct dd d = node_at(group, i, p);
            kept[count] = negative ? dd_neg(d) : d;
            least = dd_min(least, kept[count++]);
            limit = least.hi + node->blend + 1e-12 * (fabs(least.hi) + node->blend);
        }
        if (next == start) // it was the first
            next = nodes[next].end;
        if (next >= node->end)
            break;
        i = next;
        next = nodes[next].end;
    }
    if (node->blend > 0 && count > 1)
        least = smooth_minimum(kept, count, node->blend);
    return node->operation == NODE_UNION ? least : dd_neg(least);
}

static struct dd twisted(const struct node *node, struct dd r[3]) {
    struct dd flat[3] = {r[0], dd_from(0), r[2]}, limit = dd_from(node->twist_radius);
    struct dd rho = dd_norm(flat), x = r[0], z = r[2];
    if (dd_sub(rho, limit).hi > 0) {
        struct dd inward = dd_div(limit, rho);
        x = dd_mul(x, inward);
        z = dd_mul(z, inward);
    }
    struct dd angle = dd_scale(r[1], node->twist), s = dd_sine(angle, 0), c = dd_sine(angle, 1);
    r[0] = dd_sub(dd_mul(c, x), dd_mul(s, z));
    r[2] = dd_add(dd_mul(s, x), dd_mul(c, z));
    return rho;
}

static struct dd node_at(const struct solid *group, int index, const struct dd p[3]) {
    const struct node *node = &group->nodes[index];
    struct dd q[3], r[3], f, rho = dd_from(-1);
    to_frame(&group->inside[index], p, q);
    for (int i = 0; i < 3; i++)
        r[i] = q[i] = node->mirror[i] ? dd_abs(q[i]) : q[i];
    if (node->twist != 0)
        rho = twisted(node, r);
    if (node->operation != NODE_SHAPE)
        f = operate(group, index, r);
    else
        switch ((int)node->shape.type) {
        case SHAPE_CAPSULE: f = capsule(r, &node->shape); break;
        case SHAPE_ELLIPSOID: f = ellipsoid(r, &node->shape); break;
        case SHAPE_GYROID: f = gyroid(r, &node->shape); break;
        default: f = shape_distance(&node->shape, r);
        }
    if (dd_sub(rho, dd_from(node->twist_radius)).hi > 0)
        f = dd_max(f, dd_sub(rho, dd_from(node->twist_inner)));
    if (node->amplitude != 0) {
        struct dd wave = dd_from(node->amplitude);
        for (int i = 0; i < 3; i++)
            wave = dd_mul(wave, dd_sine(dd_scale(q[i], node->frequency[i]), 0));
        f = dd_add(f, wave);
    }
    if (node->shell > 0)
        f = dd_sub(dd_abs(f), dd_from(node->shell));
    return node->offset != 0 ? dd_sub(f, dd_from(node->offset)) : f;
}

struct dd field_at(const struct solid *group, const struct dd p[3]) {
    return node_at(group, group->shape->group.root, p);
}

struct dd distance_to(const struct solid *solid, const struct dd p[3]) {
    struct dd local[3];
    to_frame(solid, p, local);
    if (solid->shape->type != SHAPE_GROUP)
        return shape_distance(solid->shape, local);
    double slope = solid->nodes[solid->shape->group.root].lipschitz;
    return dd_div(field_at(solid, local), dd_from(slope));
}
