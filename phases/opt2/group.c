// Groups of shapes. A tree of operations is a program in postfix order, compiled once per scene: children leave
// their values on a stack, and an operation folds the last of them into one. A node without a frame of its own,
// a twist or a displacement has no instruction for it.
#include "sdf.h"

enum { MAX_FRAMES = 2 * (SCENE_MAX_DEPTH + 2), MAX_VALUES = SCENE_MAX_NODES };

static double sdf_capsule(const double *p, const struct primitive *s) {
    COUNT(sdf_capsule, call);
    double y = p[1] - clamp(p[1], -s->cone.half_height, s->cone.half_height);
    return sqrt(p[0] * p[0] + y * y + p[2] * p[2]) - s->cone.bottom_radius;
}

// A bound: the distance is at least (|p/r| − 1)·min r.
static double sdf_ellipsoid(const double *p, const struct primitive *s) {
    COUNT(sdf_ellipsoid, call);
    double q[3];
    for (int i = 0; i < 3; i++)
        q[i] = p[i] * s->ellipsoid.inv_radii[i];
    return (vec_norm(q) - 1.0) * s->ellipsoid.least;
}

static double sdf_gyroid(const double *p, const struct primitive *s) {
    COUNT(sdf_gyroid, call);
    double sine[3], cosine[3];
    for (int i = 0; i < 3; i++) {
        sine[i] = sin(p[i] * s->gyroid.frequency);
        cosine[i] = cos(p[i] * s->gyroid.frequency);
    }
    double level = sine[0] * cosine[1] + sine[1] * cosine[2] + sine[2] * cosine[0];
    return fabs(level) * s->gyroid.scale - s->gyroid.half_thickness;
}

static double leaf_distance(const double *point, const struct primitive *s) {
    double p[3];
    apply_transform(point, s, p);
    switch (s->type) {
    case SHAPE_SPHERE: return sdf_sphere(p, s);
    case SHAPE_BOX: return sdf_box(p, s);
    case SHAPE_TORUS: return sdf_torus(p, s);
    case SHAPE_CONE: return sdf_cone(p, s);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(p, s);
    case SHAPE_PLANE: return sdf_plane(p, s);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(p, s);
    case SHAPE_CAPSULE: return sdf_capsule(p, s);
    case SHAPE_ELLIPSOID: return sdf_ellipsoid(p, s);
    default: return sdf_gyroid(p, s);
    }
}

// Children's values with their signs: all operations are minima of them, with the first one's sign.
static double signed_value(const struct node *node, const double *value, int i) {
    bool positive = i ? node->operation != NODE_INTERSECTION : node->operation == NODE_UNION;
    return positive ? value[i] : -value[i];
}

// The minimum of all values; with blend k > 0 the smooth minimum of all at once: the least Σ wᵢdᵢ + k/2·(Σ wᵢ² − 1)
// of any weights w ≥ 0 of sum 1. There wᵢ = max(τ − eᵢ, 0)/k with eᵢ = dᵢ − least; τ by Michelot's method. (A. F. T.
// Martins, R. F. Astudillo, "From softmax to sparsemax", ICML 2016.)
static double fold(const struct node *node, const double *value, double *least, double *tau) {
    COUNT(fold, call);
    double k = *tau = node->blend, folded = *least = INFINITY;
    for (int i = 0; i < node->children; i++) {
        COUNT(fold, child);
        folded = *least = min_of(signed_value(node, value, i), *least);
    }
    if (k > 0.0) {
        double squares;
        int kept = node->children + 1, before;
        do { // kept are those below τ, which falls from k
            COUNT(fold, pass);
            double sum = squares = 0.0;
            before = kept;
            kept = 0;
            for (int i = 0; i < node->children; i++) {
                COUNT(fold, tested);
                double e = signed_value(node, value, i) - *least;
                if (e < *tau) {
                    COUNT(fold, kept);
                    kept++;
                    sum += e;
                    squares += e * e;
                }
            }
            *tau = (k + sum) / kept;
        } while (kept < before && kept > 1);
        COUNT(fold, blended);
        folded = *least + 0.5 * ((kept * *tau * *tau - squares) / k - k);
    }
    return node->operation == NODE_UNION ? folded : -folded;
}

// Mixes the children's surfaces into the first one's place by the weights of fold(). A sharp operation takes the
// first child of the least value.
static void fold_surfaces(const struct node *node, const double *value, double least, double tau,
                          struct material *surface) {
    struct material mixed = {.reflectivity = 0.0};
    bool decided = false;
    for (int i = 0; i < node->children && !decided; i++) {
        COUNT(fold_surfaces, child);
        double e = signed_value(node, value, i) - least;
        decided = node->blend == 0.0 && e == 0.0;
        double weight = node->blend > 0.0 ? max_of(tau - e, 0.0) / node->blend : decided;
        vec_along(mixed.color, surface[i].color, weight, mixed.color);
        mixed.reflectivity += weight * surface[i].reflectivity;
        mixed.shininess += weight * surface[i].shininess;
    }
    surface[0] = mixed;
}

static void to_frame(const double *point, const struct instruction *in, double *p) {
    apply_transform(point, &in->primitive, p);
    for (int i = 0; i < 3; i++)
        if (in->node->mirror[i]) {
            COUNT(to_frame, mirror);
            p[i] = fabs(p[i]);
        }
}

static void twisted(const double *p, const struct node *node, double *out) {
    COUNT(twisted, call);
    double angle = node->twist * p[1], radius = sqrt(p[0] * p[0] + p[2] * p[2]);
    double inward = node->twist_radius / max_of(radius, node->twist_radius);
    double c = inward * cos(angle), s = inward * sin(angle);
    out[0] = c * p[0] - s * p[2];
    out[1] = p[1];
    out[2] = s * p[0] + c * p[2];
}

// The value of a node with the end of its twist, displacement, shell and offset, at the point in its frame.
static double modified(const struct node *node, const double *p, double f) {
    COUNT(modified, call);
    if (node->twist != 0.0) {
        COUNT(modified, twisted);
        f = max_of(f, sqrt(p[0] * p[0] + p[2] * p[2]) - node->twist_inner);
    }
    if (node->amplitude > 0.0) {
        COUNT(modified, displaced);
        const double *w = node->frequency;
        f += node->amplitude * sin(w[0] * p[0]) * sin(w[1] * p[1]) * sin(w[2] * p[2]);
    }
    if (node->shell > 0.0) {
        COUNT(modified, shell);
        f = fabs(f) - node->shell;
    }
    return f - node->offset;
}

// Runs the program at a point of the group's frame. `surfaces`, unless NULL, gets the material at its start, and
// has room for one of each value.
static double run(const double *p, const struct primitive *group, const struct material *materials,
                  struct material *surfaces) {
    double frame[MAX_FRAMES][3], value[MAX_VALUES], least, tau;
    int top = -1;
    vec_set(p, frame[0]);
    for (int i = 0; i < group->group.length; i++) {
        const struct instruction *in = &group->group.program[i];
        const struct node *node = in->node;
        double *at = frame[in->frame], *next = at + 3;
        switch (in->opcode) {
        case TO_FRAME: to_frame(at, in, next); break;
        case TWIST: twisted(at, node, next); break;
        case LEAF:
            value[++top] = leaf_distance(at, &in->primitive);
            if (surfaces)
                surfaces[top] = materials[node->shape.material];
            break;
        case FOLD: {
            top -= node->children - 1;
            double folded = fold(node, value + top, &least, &tau);
            if (surfaces)
                fold_surfaces(node, value + top, least, tau, surfaces + top);
            value[top] = folded;
            break;
        }
        case MODIFY: value[top] = modified(node, at, value[top]); break;
        }
    }
    return value[0];
}

double sdf_group(const double *p, const struct primitive *group) {
    COUNT(sdf_group, call);
    return run(p, group, NULL, NULL) * group->group.inv_lipschitz;
}

void group_surface(const double *point, const struct primitive *group, const struct model *model,
                   struct material *surface) {
    struct material surfaces[MAX_VALUES];
    double p[3];
    apply_transform(point, group, p);
    run(p, group, model->materials, surfaces);
    *surface = surfaces[0];
}
