// Groups: a tree of shapes by recursion, with every constant of a node taken once per scene. For the methods see
// baseline: A. Ricci (The Computer Journal 16, 1973); C. Michelot (J. Optimization Theory and Applications 50, 1986);
// A. Martins and R. Astudillo (ICML 2016).
#include "sdf.h"

void group_prepare(const struct model *model, struct group_node *nodes) {
    for (int i = 0; i < model->node_count; i++) {
        struct group_node *made = &nodes[i];
        const struct node *node = &model->nodes[i];
        const struct shape *shape = &node->shape;
        const double *radius = shape->ellipsoid.radius;
        *made = (struct group_node){.node = *node, .half_blend = 0.5 * node->blend};
        made->twice_blend = 2.0 * node->blend;
        for (int axis = 0; axis < 3; axis++) {
            double radians = shape->rotation_degrees[axis] * (M_PI / 180.0);
            made->cosine[axis] = cos(radians);
            made->sine[axis] = sin(radians);
            made->rotated[axis] = radians != 0.0;
            made->repeated = made->repeated || shape->repeat[axis] > 0.0;
            made->moved = made->moved || radians != 0.0 || shape->position[axis] != 0.0;
            made->mirrored = made->mirrored || node->mirror[axis];
        }
        made->moved = made->moved || made->repeated;
        made->modified =
            node->twist != 0.0 || node->amplitude > 0.0 || node->shell > 0.0 || node->offset != 0.0;
        if ((int)shape->type == SHAPE_ELLIPSOID)
            made->least = fmin(radius[0], fmin(radius[1], radius[2]));
        if ((int)shape->type == SHAPE_GYROID) {
            made->scale = 2.0 * M_PI / shape->gyroid.cell;
            made->unit = made->scale * sqrt(3.0);
        }
    }
}

static inline void turn(double *u, double *v, double c, double s) {
    double old = *u;
    COUNT(node_point, turn);
    *u = c * old - s * *v;
    *v = s * old + c * *v;
}

static inline void node_point(const double *p, const struct group_node *made, double *q) {
    COUNT(node_point, call);
    const struct shape *shape = &made->node.shape;
    for (int k = 0; k < 3; k++)
        q[k] = p[k];
    if (made->moved) {
        COUNT(node_point, moved);
        for (int k = 0; k < 3; k++)
            q[k] -= shape->position[k];
        if (made->rotated[0])
            turn(&q[1], &q[2], made->cosine[0], made->sine[0]);
        if (made->rotated[1])
            turn(&q[0], &q[2], made->cosine[1], made->sine[1]);
        if (made->rotated[2])
            turn(&q[0], &q[1], made->cosine[2], made->sine[2]);
        for (int k = 0; k < 3 && made->repeated; k++)
            q[k] = wrap(q[k], shape->repeat[k]);
    }
    for (int k = 0; k < 3 && made->mirrored; k++)
        if (made->node.mirror[k])
            q[k] = (COUNT(node_point, mirror), fabs(q[k]));
}

// The point as the node's children, or its shape, see it. Returns its distance from the axis less twist_inner.
static inline double twist_point(const double *q, const struct node *node, double *r) {
    COUNT(twist_point, call);
    for (int k = 0; k < 3; k++)
        r[k] = q[k];
    if (node->twist == 0.0)
        return -INFINITY;
    COUNT(twist_point, twisted);
    double reach = sqrt(q[0] * q[0] + q[2] * q[2]), scale = 1.0, angle = node->twist * q[1];
    if (reach > node->twist_radius)
        scale = (COUNT(twist_point, outside), node->twist_radius / reach);
    double c = cos(angle) * scale, s = sin(angle) * scale;
    r[0] = c * q[0] - s * q[2];
    r[2] = s * q[0] + c * q[2];
    return reach - node->twist_inner;
}

CALL double sdf_capsule(const double *p, const struct shape *shape) {
    COUNT(sdf_capsule, call);
    double h = shape->capsule.half_height, y = p[1] - clamp(p[1], -h, h);
    return sqrt(p[0] * p[0] + y * y + p[2] * p[2]) - shape->capsule.radius;
}

// A bound, as the next.
CALL double sdf_ellipsoid(const double *p, const struct group_node *made) {
    COUNT(sdf_ellipsoid, call);
    const double *r = made->node.shape.ellipsoid.radius;
    double x = p[0] / r[0], y = p[1] / r[1], z = p[2] / r[2];
    return (sqrt(x * x + y * y + z * z) - 1.0) * made->least;
}

CALL double sdf_gyroid(const double *p, const struct group_node *made) {
    COUNT(sdf_gyroid, call);
    double x = p[0] * made->scale, y = p[1] * made->scale, z = p[2] * made->scale;
    double level = sin(x) * cos(y) + sin(y) * cos(z) + sin(z) * cos(x);
    return fabs(level) / made->unit - 0.5 * made->node.shape.gyroid.thickness;
}

static double distance_of_node(const double *p, const struct group_node *made) {
    switch ((int)made->node.shape.type) {
    case SHAPE_CAPSULE: return sdf_capsule(p, &made->node.shape);
    case SHAPE_ELLIPSOID: return sdf_ellipsoid(p, made);
    case SHAPE_GYROID: return sdf_gyroid(p, made);
    default: return distance_at(p, &made->node.shape);
    }
}

// Returns the smooth minimum of the distances, and where each child's weight ends: it is max(end − d, 0)/k.
static double smooth_minimum(const double *d, const struct group_node *made, double *end) {
    COUNT(smooth_minimum, call);
    int count = made->node.children;
    double least = d[0], k = made->node.blend, reach = k, square = 0.0;
    for (int i = 1; i < count; i++)
        least = (COUNT(smooth_minimum, child), fmin(least, d[i]));
    for (double next = k;; reach = next) { // Michelot: fewer children have a part each time
        double sum = k;
        int parts = 0;
        for (int i = 0; i < count; i++)
            if (COUNT(smooth_minimum, test), d[i] - least < reach) {
                COUNT(smooth_minimum, part);
                sum += d[i] - least;
                parts++;
            }
        next = sum / parts;
        if (COUNT(smooth_minimum, pass), !(next < reach))
            break;
    }
    for (int i = 0; i < count; i++) {
        COUNT(smooth_minimum, weighed);
        double part = fmax(reach - (d[i] - least), 0.0);
        square += part * part;
    }
    *end = least + reach;
    return *end - made->half_blend - square / made->twice_blend;
}

static double sdf_node(const double *p, const struct group_node *nodes, int index, double *room);

// Writes the children's distances, with the signs that make every operation a minimum: intersection is
// −min(−d), difference −min(−d₁, d₂, …).
static void child_distances(const double *p, const struct group_node *nodes, int index,
                            double *room) {
    const struct node *node = &nodes[index].node;
    bool negative = node->operation != NODE_UNION;
    for (int i = index + 1, count = 0; i < node->end; i = nodes[i].node.end, count++) {
        double distance = sdf_node(p, nodes, i, room + count);
        room[count] = negative ? -distance : distance;
        negative = negative && node->operation == NODE_INTERSECTION;
    }
}

// Returns the child that decides a sharp operation, the first of equals.
static int least_child(const double *room, int count) {
    COUNT(least_child, call);
    int best = 0;
    for (int i = 1; i < count; i++)
        if (COUNT(least_child, child), room[i] < room[best])
            best = i;
    return best;
}

// Returns the field of a node (struct node) at a point of its parent's coordinates. `room` has a number for each node
// of the tree.
static double sdf_node(const double *p, const struct group_node *nodes, int index, double *room) {
    COUNT(sdf_node, call);
    const struct group_node *made = &nodes[index];
    const struct node *node = &made->node;
    double q[3], r[3], end, f;
    node_point(p, made, q);
    double beyond = twist_point(q, node, r);
    if (node->operation == NODE_SHAPE)
        f = distance_of_node(r, made);
    else {
        child_distances(r, nodes, index, room);
        f = node->blend > 0.0 ? smooth_minimum(room, made, &end)
                              : room[least_child(room, node->children)];
        f = node->operation == NODE_UNION ? f : -f;
    }
    if (!made->modified)
        return f;
    COUNT(sdf_node, modified);
    if (beyond > f)
        f = beyond;
    const double *w = node->frequency;
    if (node->amplitude > 0.0) {
        COUNT(sdf_node, displaced);
        f += node->amplitude * sin(w[0] * q[0]) * sin(w[1] * q[1]) * sin(w[2] * q[2]);
    }
    if (node->shell > 0.0)
        f = (COUNT(sdf_node, shell), fabs(f) - node->shell);
    return f - node->offset;
}

double sdf_group(const double *p, const struct group_node *nodes, int root) {
    COUNT(sdf_group, call);
    double room[SCENE_MAX_NODES];
    return sdf_node(p, nodes, root, room) / nodes[root].node.lipschitz;
}

// Returns the material of a node's surface near a point of its parent's coordinates: of a sharp operation, that of the
// child that decides; of a blend, the children's in the shares of their weights.
static struct material node_material(const double *p, const struct group_node *nodes, int index,
                                     const struct material *materials, double *room) {
    COUNT(node_material, call);
    const struct node *node = &nodes[index].node;
    if (node->operation == NODE_SHAPE)
        return materials[node->shape.material];
    COUNT(node_material, group);
    struct material mixed = {0};
    double q[3], r[3], end = 0.0;
    node_point(p, &nodes[index], q);
    twist_point(q, node, r);
    child_distances(r, nodes, index, room);
    int best = least_child(room, node->children), child = 0;
    if (node->blend > 0.0)
        smooth_minimum(room, &nodes[index], &end);
    for (int i = index + 1; i < node->end; i = nodes[i].node.end, child++) {
        double weight = child == best;
        if (node->blend > 0.0)
            weight = (COUNT(node_material, weight), (end - room[child]) / node->blend);
        if (!(COUNT(node_material, child), weight > 0.0))
            continue;
        COUNT(node_material, part);
        struct material one = node_material(r, nodes, i, materials, room + node->children);
        for (int k = 0; k < 3; k++)
            mixed.color[k] += weight * one.color[k];
        mixed.reflectivity += weight * one.reflectivity;
        mixed.shininess += weight * one.shininess;
    }
    return mixed;
}

struct material group_material(const double *p, const struct group_node *nodes, int root,
                               const struct material *materials) {
    double room[SCENE_MAX_NODES];
    return node_material(p, nodes, root, materials, room);
}
