// The normal at a hit, enclosed: the gradient of the surface's equation at the enclosed point.
#include "groups/field.h"
#include "trace.h"

static void normalize(struct ivq v[3]) {
    struct ivq length = sqrt_q(norm_sq_q(v));
    for (int i = 0; i < 3; i++)
        v[i] = div_q(v[i], length);
}

// A fractal's normal by the scene's own rule: forward differences over normal_step, in double-double. The gradient
// itself would show leaves of it that are far smaller than a pixel.
static void fractal_normal(const struct prepared *prepared, const struct ivq point[3],
                           struct ivq n[3]) {
    struct dd p[3], slope[3], step = dd_from(prepared->model.march.normal_step);
    int nearest;
    for (int i = 0; i < 3; i++)
        p[i] = dd_from_quad(mid_q(point[i]));
    struct dd here = distance_to_scene(prepared, p, false, &nearest);
    for (int i = 0; i < 3; i++) {
        struct dd beside[3] = {p[0], p[1], p[2]};
        beside[i] = dd_add(p[i], step);
        slope[i] = dd_sub(distance_to_scene(prepared, beside, false, &nearest), here);
    }
    struct dd length = dd_norm(slope);
    for (int i = 0; i < 3; i++) {
        struct dd x = dd_div(slope[i], length);
        n[i].lo = n[i].hi = (quad)x.hi + (quad)x.lo;
    }
}

// A group's normal: its field's gradient. Where two children meet, and the gradient is one of several, it is not narrow.
static bool group_normal(const struct prepared *prepared, const struct solid *solid,
                         const struct ivq p[3], struct ivq n[3], struct material *material) {
    struct ivq gradient[3];
    bool sure = field_surface(solid, p, prepared->model.materials, gradient, material);
    for (int i = 0; i < 3; i++) {
        sure = sure && gradient[i].hi - gradient[i].lo < 1e-9;
        n[i] = gradient[i];
    }
    normalize(n);
    return sure;
}

// code: 2·axis + 1 for the upper side.
static void side_normal(struct ivq n[3], int code) {
    for (int i = 0; i < 3; i++)
        n[i] = point_q(i == code / 2 ? (code & 1 ? 1 : -1) : 0);
}

// Computes the unit gradient of the shape's equation at the local point p of that face.
static void surface_normal(const struct shape *shape, int face, const struct ivq p[3],
                           struct ivq n[3]) {
    if (face >= FACE_CELL) {
        side_normal(n, face - FACE_CELL);
        return;
    }
    struct ivq rho = sqrt_q(add_q(square_q(p[0]), square_q(p[2])));
    switch (shape->type) {
    case SHAPE_BOX: side_normal(n, face); return;
    case SHAPE_PLANE:
        for (int i = 0; i < 3; i++)
            n[i] = point_q(shape->plane.normal[i]);
        break;
    case SHAPE_ROUNDED_BOX: // away from the nearest point of the inner box
        for (int i = 0; i < 3; i++) {
            struct ivq half = point_q(shape->box.half_size[i]), over = sub_q(p[i], half),
                       under = add_q(p[i], half);
            n[i] = (struct ivq){(under.lo < 0 ? under.lo : 0) + (over.lo > 0 ? over.lo : 0),
                                (under.hi < 0 ? under.hi : 0) + (over.hi > 0 ? over.hi : 0)};
        }
        break;
    case SHAPE_OCTAHEDRON:
        for (int i = 0; i < 3; i++)
            n[i] = point_q(face >> i & 1 ? 1 : -1);
        break;
    case SHAPE_CONE:
        if (face != FACE_SIDE) {
            side_normal(n, face == FACE_TOP ? 3 : 2);
            return;
        }
        n[0] = div_q(p[0], rho);
        n[1] = div_q(sub_q(point_q(shape->cone.bottom_radius), point_q(shape->cone.top_radius)),
                     point_q(2 * shape->cone.half_height));
        n[2] = div_q(p[2], rho);
        break;
    case SHAPE_TORUS: {
        struct ivq ring = div_q(sub_q(rho, point_q(shape->torus.major_radius)), rho);
        n[0] = mul_q(p[0], ring);
        n[1] = p[1];
        n[2] = mul_q(p[2], ring);
        break;
    }
    default:
        for (int i = 0; i < 3; i++)
            n[i] = p[i];
    }
    normalize(n);
}

static bool finite_vector(const struct ivq v[3]) {
    for (int i = 0; i < 3; i++)
        if (!(v[i].lo - v[i].lo == 0) || !(v[i].hi - v[i].hi == 0))
            return false;
    return true;
}

void find_normal(const struct prepared *prepared, const struct ray_q *ray, struct hit *hit) {
    const struct solid *solid = &prepared->solids[hit->shape];
    const struct shape *shape = solid->shape;
    struct ivq moved[3], local[3], local_normal[3];
    hit->material = prepared->model.materials[shape->material];
    if (is_fractal(shape->type))
        fractal_normal(prepared, hit->point, hit->normal);
    else {
        for (int i = 0; i < 3; i++)
            moved[i] = sub_q(hit->point[i], point_q(shape->position[i]));
        for (int i = 0; i < 3; i++) {
            local[i] = solid->rotated ? dot_q(solid->rotation_q[i], moved) : moved[i];
            if (shape->repeat[i] > 0)
                local[i] = sub_q(local[i], mul_q(point_q(shape->repeat[i]), point_q(hit->cell[i])));
        }
        if (shape->type == SHAPE_GROUP &&
            !group_normal(prepared, solid, local, local_normal, &hit->material))
            hit->normal_sure = false;
        if (shape->type != SHAPE_GROUP || hit->face >= FACE_CELL)
            surface_normal(shape, hit->face, local, local_normal);
        for (int i = 0; i < 3; i++) {
            struct ivq column[3];
            for (int j = 0; j < 3; j++)
                column[j] = solid->rotation_q[j][i];
            hit->normal[i] = solid->rotated ? dot_q(column, local_normal) : local_normal[i];
        }
    }
    struct ivq facing = dot_q(ray->d, hit->normal);
    if (!finite_vector(hit->normal)) { // no gradient, as at a centre: against the ray
        for (int i = 0; i < 3; i++)
            hit->normal[i] = neg_q(ray->d[i]);
        normalize(hit->normal);
        hit->normal_sure = false;
    } else if (mid_q(facing) > 0)
        for (int i = 0; i < 3; i++)
            hit->normal[i] = neg_q(hit->normal[i]);
    if (has_zero_q(facing))
        hit->normal_sure = false;
}
