// Groups: a tree of shapes by plain recursion. Union, intersection and difference by minima and maxima: A. Ricci,
// "A constructive geometry for computer graphics", The Computer Journal 16 (1973). A blend is a smooth minimum of all
// children at once: min over weights w ≥ 0, Σw = 1, of Σ wᵢdᵢ + (k/2)(Σ wᵢ² − 1). Its weights are the projection on the
// simplex of C. Michelot (J. Optimization Theory and Applications 50, 1986), the "sparsemax" of A. Martins and
// R. Astudillo (ICML 2016). For two children it is I. Quilez's quadratic smooth minimum.
#include "sdf.h"

CALL double sdf_capsule(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_capsule, call);
    double h = shape->capsule.half_height;
    return vec_norm(new_vector(p.x, p.y - clamp(p.y, -h, h), p.z)) - shape->capsule.radius;
}

// A bound: no point within this distance is on the surface.
CALL double sdf_ellipsoid(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_ellipsoid, call);
    struct vec3 r = *vec_at(shape->ellipsoid.radius);
    return (vec_norm(new_vector(p.x / r.x, p.y / r.y, p.z / r.z)) - 1.0) *
           fmin(r.x, fmin(r.y, r.z));
}

// A. Schoen's gyroid, as the level set sin x cos y + sin y cos z + sin z cos x = 0 (NASA TN D-5541, 1970), whose slope
// is √3 at most. A bound.
CALL double sdf_gyroid(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_gyroid, call);
    double scale = 2.0 * M_PI / shape->gyroid.cell;
    p = vec_scale(p, scale);
    double level = sin(p.x) * cos(p.y) + sin(p.y) * cos(p.z) + sin(p.z) * cos(p.x);
    return fabs(level) / (scale * sqrt(3.0)) - 0.5 * shape->gyroid.thickness;
}

static double distance_of_node(struct vec3 p, const struct shape *shape) {
    switch ((int)shape->type) {
    case SHAPE_CAPSULE: return sdf_capsule(p, shape);
    case SHAPE_ELLIPSOID: return sdf_ellipsoid(p, shape);
    case SHAPE_GYROID: return sdf_gyroid(p, shape);
    default: return distance_of[shape->type](p, shape);
    }
}

static inline double mirror(double x, bool mirrored) {
    return mirrored ? (COUNT(node_point, mirror), fabs(x)) : x;
}

// The point in the shape's frame: as apply_transform, which ablations change.
CALL struct vec3 place_point(struct vec3 p, const struct shape *shape) {
    static const int pair[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    COUNT(place_point, call);
    p = vec_sub(p, *vec_at(shape->position));
    double x[3] = {p.x, p.y, p.z};
    for (int axis = 0; axis < 3; axis++) {
        double angle = shape->rotation_degrees[axis] * (M_PI / 180.0), c = cos(angle),
               s = sin(angle), *u = &x[pair[axis][0]], *v = &x[pair[axis][1]], old = *u;
        *u = c * old - s * *v;
        *v = s * old + c * *v;
    }
    const double *cell = shape->repeat;
    p = new_vector(x[0], x[1], x[2]);
    return cell[0] > 0 || cell[1] > 0 || cell[2] > 0 ? repeat_point(p, cell) : p;
}

CALL struct vec3 node_point(struct vec3 p, const struct node *node) {
    COUNT(node_point, call);
    p = place_point(p, &node->shape);
    return new_vector(mirror(p.x, node->mirror[0]), mirror(p.y, node->mirror[1]),
                      mirror(p.z, node->mirror[2]));
}

// The point as its children, or its shape, see it. `beyond` gets its distance from the axis less twist_inner.
CALL struct vec3 twist_point(struct vec3 p, const struct node *node, double *beyond) {
    COUNT(twist_point, call);
    *beyond = -INFINITY;
    if (node->twist == 0.0)
        return p;
    COUNT(twist_point, twisted);
    double reach = vec_norm(new_vector(p.x, 0.0, p.z));
    double scale = 1.0, angle = node->twist * p.y;
    if (reach > node->twist_radius)
        scale = (COUNT(twist_point, outside), node->twist_radius / reach);
    double c = cos(angle) * scale, s = sin(angle) * scale;
    *beyond = reach - node->twist_inner;
    return new_vector(c * p.x - s * p.z, p.y, s * p.x + c * p.z);
}

// Returns the smooth minimum of the distances, and where each child's weight ends: it is max(end − d, 0)/k.
CALL double smooth_minimum(const double *d, int count, double k, double *end) {
    COUNT(smooth_minimum, call);
    double least = d[0], reach = k, square = 0.0;
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
    return *end - 0.5 * k - square / (2.0 * k);
}

CALL double sdf_node(struct vec3 p, const struct node *nodes, int index, double *room);

// Writes the children's distances, with the signs that make every operation a minimum: intersection is
// −min(−d), difference −min(−d₁, d₂, …).
CALL void child_distances(struct vec3 p, const struct node *nodes, int index, double *room) {
    int count = 0;
    enum operation operation = nodes[index].operation;
    for (int i = index + 1; i < nodes[index].end; i = nodes[i].end, count++) {
        double distance = sdf_node(p, nodes, i, room + count);
        bool negative =
            operation == NODE_INTERSECTION || (operation == NODE_DIFFERENCE && count == 0);
        room[count] = negative ? -distance : distance;
    }
}

// Returns the child that decides a sharp operation, the first of equals.
CALL int least_child(const double *room, int count) {
    COUNT(least_child, call);
    int best = 0;
    for (int i = 1; i < count; i++)
        if (COUNT(least_child, child), room[i] < room[best])
            best = i;
    return best;
}

// Returns the field of a node (struct node) at a point of its parent's coordinates. `room` has a number for each node
// of the tree.
CALL double sdf_node(struct vec3 p, const struct node *nodes, int index, double *room) {
    COUNT(sdf_node, call);
    const struct node *node = &nodes[index];
    double beyond, end, f;
    struct vec3 q = node_point(p, node), r = twist_point(q, node, &beyond);
    if (node->operation == NODE_SHAPE)
        f = distance_of_node(r, &node->shape);
    else {
        COUNT(sdf_node, operation);
        child_distances(r, nodes, index, room);
        f = node->blend > 0.0 ? smooth_minimum(room, node->children, node->blend, &end)
                              : room[least_child(room, node->children)];
        if (node->operation != NODE_UNION)
            f = -f;
    }
    if (beyond > f)
        f = beyond;
    const double *w = node->frequency;
    if (node->amplitude > 0.0) {
        COUNT(sdf_node, displaced);
        f += node->amplitude * sin(w[0] * q.x) * sin(w[1] * q.y) * sin(w[2] * q.z);
    }
    if (node->shell > 0.0)
        f = (COUNT(sdf_node, shell), fabs(f) - node->shell);
    return f - node->offset;
}

double sdf_group(struct vec3 p, const struct shape *shape) {
    COUNT(sdf_group, call);
    double room[SCENE_MAX_NODES];
    const struct node *nodes = shape->group.nodes;
    return sdf_node(p, nodes, shape->group.root, room) / nodes[shape->group.root].lipschitz;
}

// Returns the material of a node's surface near a point of its parent's coordinates: of a sharp operation, that of the
// child that decides; of a blend, the children's in the shares of their weights.
CALL struct material node_material(struct vec3 p, const struct node *nodes, int index,
                                   const struct material *materials, double *room) {
    COUNT(node_material, call);
    const struct node *node = &nodes[index];
    if (node->operation == NODE_SHAPE)
        return materials[node->shape.material];
    COUNT(node_material, group);
    struct material mixed = {0};
    double beyond, end = 0.0;
    struct vec3 q = node_point(p, node), r = twist_point(q, node, &beyond);
    child_distances(r, nodes, index, room);
    int best = least_child(room, node->children), child = 0;
    if (node->blend > 0.0)
        smooth_minimum(room, node->children, node->blend, &end);
    for (int i = index + 1; i < node->end; i = nodes[i].end, child++) {
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

struct material group_material(struct vec3 p, const struct shape *group,
                               const struct model *model) {
    double room[SCENE_MAX_NODES];
    return node_material(place_point(p, group), model->nodes, group->group.root, model->materials,
                         room);
}
