// Bounds of groups: of every node a sphere about its solid, its field's greatest slope, and how fast the field
// grows outside the sphere. See struct node.
//
// Each rule keeps the promise f(p) ≥ growth·(|p − centre| − radius) outside the sphere. So f < s lies within the
// sphere of radius + s/growth, by which offsets, shells, displacements and blends grow it.
#include <math.h>

#include "scene/internal.h"
#include "scene/vector.h"

// Multiplies radii and slopes, against rounding.
static const double MARGIN = 1 + 4e-15;

// Returns the radius of the shape's sphere about 0 in its own coordinates.
static double shape_radius(const struct shape *s) {
    const double *half = s->box.half_size, *radius = s->ellipsoid.radius;
    switch ((int)s->type) {
    case SHAPE_SPHERE: return s->sphere.radius;
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX: return sqrt(dot3(half, half)) + s->box.rounding;
    case SHAPE_TORUS: return s->torus.major_radius + s->torus.minor_radius;
    case SHAPE_CONE:
        return hypot(fmax(s->cone.bottom_radius, s->cone.top_radius), s->cone.half_height);
    case SHAPE_OCTAHEDRON: return s->octahedron.radius;
    case SHAPE_CAPSULE: return s->capsule.half_height + s->capsule.radius;
    case SHAPE_ELLIPSOID: return fmax(radius[0], fmax(radius[1], radius[2]));
    default: return INFINITY; // a plane or a gyroid
    }
}

// Returns how far the shape reaches from the y axis of its own coordinates.
static double shape_reach(const struct shape *s) {
    switch ((int)s->type) {
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX:
        return hypot(s->box.half_size[0], s->box.half_size[2]) + s->box.rounding;
    case SHAPE_CONE: return fmax(s->cone.bottom_radius, s->cone.top_radius);
    case SHAPE_CAPSULE: return s->capsule.radius;
    case SHAPE_ELLIPSOID: return fmax(s->ellipsoid.radius[0], s->ellipsoid.radius[2]);
    default: return shape_radius(s);
    }
}

// The sphere about the children's: about the middle of the box of their centres.
static void enclose(const struct node *nodes, int first, struct node *parent) {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    parent->radius = 0;
    for (int i = first; i < parent->end; i = nodes[i].end)
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], nodes[i].centre[k]);
            high[k] = fmax(high[k], nodes[i].centre[k]);
        }
    for (int k = 0; k < 3; k++)
        parent->centre[k] = (low[k] + high[k]) / 2;
    for (int i = first; i < parent->end; i = nodes[i].end) {
        double d[3];
        for (int k = 0; k < 3; k++)
            d[k] = nodes[i].centre[k] - parent->centre[k];
        parent->radius = fmax(parent->radius, sqrt(dot3(d, d)) + nodes[i].radius);
        parent->growth = fmin(parent->growth, nodes[i].growth);
    }
    // Where all children are equal, a blend is lower than they are by this.
    parent->radius += parent->blend / 2 * (1 - 1.0 / parent->children) / parent->growth;
}

// The sphere of an intersection is its smallest child's; that of a difference is its first child's.
static void take_child(const struct node *nodes, int first, struct node *parent) {
    int best = first;
    for (int i = first; i < parent->end && parent->operation == NODE_INTERSECTION; i = nodes[i].end)
        best = nodes[i].radius < nodes[best].radius * (1 - 1e-9) ? i : best; // not by rounding
    for (int k = 0; k < 3; k++)
        parent->centre[k] = nodes[best].centre[k];
    parent->radius = nodes[best].radius;
    parent->growth = nodes[best].growth;
}

// A twist needs a cylinder about its axis that holds the solid, and what displacement, shell and offset add. Within
// it, at most ρ from the axis, the greatest stretch of (x, z) → turned by twist·y is the singular value
// (κρ + √(κ²ρ² + 4))/2 with κ = |twist| of a shear. The sphere moves onto the axis, about which everything turns.
static void bound_twist(struct node *node, double added) {
    double off = hypot(node->centre[0], node->centre[2]);
    node->radius += off;
    node->centre[0] = node->centre[2] = 0;
    double reach = node->operation == NODE_SHAPE ? shape_reach(&node->shape) : node->radius;
    // No surface lies on the cylinder: there it would have no gradient.
    node->twist_radius = (reach + added / node->growth) * (1 + 0x1p-10);
    // At ρ from the axis f is at least growth·(ρ − reach), and so, within the cylinder, ρ − twist_inner.
    node->twist_inner = (node->twist_radius - node->growth * (node->twist_radius - reach)) * MARGIN;
    double shear = fabs(node->twist) * node->twist_radius;
    node->lipschitz *= (shear + sqrt(shear * shear + 4)) / 2 * MARGIN;
    // Outside f is the larger of ρ − twist_inner, which is above `added`, and the field at the cylinder's nearest point.
    node->growth /= 2;
}

// Takes the sphere from the node's own to the parent's coordinates.
static void to_parent(struct node *node) {
    const struct shape *shape = &node->shape;
    double turn[3][3], rest[3], aside = 0;
    for (int k = 0; k < 3; k++)
        if (node->mirror[k]) { // |q|: two images at ±centre, about 0
            aside += node->centre[k] * node->centre[k];
            node->centre[k] = 0;
        }
    node->radius += sqrt(aside);
    if (shape->repeat[0] > 0 || shape->repeat[1] > 0 || shape->repeat[2] > 0)
        node->radius = INFINITY;
    rotation_matrix(shape->rotation_degrees, turn);
    for (int k = 0; k < 3; k++) // by the transpose: the inverse
        rest[k] = turn[0][k] * node->centre[0] + turn[1][k] * node->centre[1] +
                  turn[2][k] * node->centre[2];
    for (int k = 0; k < 3; k++) {
        node->centre[k] = rest[k] + shape->position[k];
        node->radius += 1e-15 * (fabs(rest[k]) + fabs(shape->position[k])); // rounding
    }
}

void node_bound(struct node *nodes, int index) {
    struct node *node = &nodes[index];
    node->lipschitz = node->growth = 1;
    node->twist_radius = node->twist_inner = 0;
    for (int k = 0; k < 3; k++)
        node->centre[k] = 0;
    if (node->operation == NODE_SHAPE) {
        const double *radius = node->shape.ellipsoid.radius;
        node->radius = shape_radius(&node->shape);
        if (node->shape.type == SHAPE_ELLIPSOID)
            node->growth = fmin(radius[0], fmin(radius[1], radius[2])) / node->radius;
    } else if (node->operation == NODE_UNION)
        enclose(nodes, index + 1, node);
    else
        take_child(nodes, index + 1, node);
    for (int i = index + 1; i < node->end; i = nodes[i].end)
        node->lipschitz = fmax(node->lipschitz, nodes[i].lipschitz);
    double added = node->amplitude + node->shell + fmax(node->offset, 0);
    if (node->twist != 0)
        bound_twist(node, added);
    // The square of the gradient of sin ωx·x · sin ωy·y · sin ωz·z is linear in each sin². So it is largest where
    // each is 0 or 1. There it is the square of one ω, or 0.
    const double *w = node->frequency;
    if (node->amplitude > 0)
        node->lipschitz += node->amplitude * MARGIN * fmax(w[0], fmax(w[1], w[2]));
    node->radius = (node->radius + added / node->growth) * MARGIN;
    to_parent(node);
}

bool node_is_distance(const struct node *nodes, int index) {
    bool is = true;
    for (int i = index; i < nodes[index].end; i++) {
        const struct node *node = &nodes[i];
        bool bent = node->twist != 0 || node->amplitude > 0 || node->shell > 0 || node->offset < 0;
        bool solid = node->shape.type != SHAPE_ELLIPSOID && node->shape.type != SHAPE_GYROID;
        bool joined = node->operation == NODE_UNION && !(node->blend > 0);
        is = is && !bent && (node->operation == NODE_SHAPE ? solid : joined);
    }
    return is;
}

void model_bound_nodes(struct model *model) {
    for (int i = model->node_count - 1; i >= 0; i--) // children stand after their parent
        node_bound(model->nodes, i);
}
