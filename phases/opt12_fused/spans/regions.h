// Regions of the picture: by half-planes through the eye and by conics. Directions are (x, y, 1) in camera axes.
#pragma once

#include <math.h>

#include "spans/spans.h"
#include "spans/tangents.h"

// By how much, in radians, a ray in float may pass a solid otherwise than its direction says. Measured on rays at
// outlines (tests/c/spans/test_span_outlines.c), with room.
#define ANGLE_ERROR 0x1p-17

// A plane as seen from a point above it. fall·(x, y, 1): how steeply a ray comes down.
struct plane_seen {
    double normal[3], offset, height, light_height, fall[3];
};

static inline struct plane_seen plane_from(const struct fused_frame *frame, int i,
                                           const double eye[3]) {
    const struct primitive *s = &frame->shape[i];
    struct plane_seen plane = {.offset = s->offset + span_dot(s->row[0], s->centre)};
    for (int k = 0; k < 3; k++) {
        plane.normal[k] = s->row[0][k];
        plane.fall[k] = -span_dot(s->row[0], frame->axis[k]);
    }
    plane.height = span_dot(plane.normal, eye) - plane.offset;
    plane.light_height = span_dot(plane.normal, frame->light) - plane.offset;
    return plane;
}

static inline struct span_item *new_item(struct fused_frame *frame, int bit) {
    struct span_item *item = &frame->item[frame->items++];
    item->bit = bit;
    item->curved = false;
    item->lefts = item->rights = 0;
    item->top = 0;
    item->bottom = frame->height;
    return item;
}

// Cuts the region by n·(x, y, 1) <= slack. Where n hardly depends on x it is turned: a region with slack >= 0 is
// no smaller by that, one with slack < 0 no larger.
static inline void add_side(struct span_item *item, const struct fused_frame *frame,
                            const double n[3], double slack) {
    double least = 1e-7 * (fabs(n[0]) + fabs(n[1]) + fabs(n[2])), x = n[0];
    if (!(least > 0))
        return;
    if (fabs(x) < least) {
        x = copysign(least, x);
        slack += copysign(2 * least * frame->reach[0], slack);
    }
    struct span_side side = {(slack - n[2]) / x, -n[1] / x};
    if (x > 0 && item->rights < SPAN_SIDES)
        item->right[item->rights++] = side;
    if (x < 0 && item->lefts < SPAN_SIDES)
        item->left[item->lefts++] = side;
}

// Cuts the region by (u·d)² >= k·|g d|² on the side u·d > 0; d = (x, y, 1), g d = the sum of g[k]·d[k].
static inline void set_conic(struct span_item *item, const struct fused_frame *frame,
                             const double u[3], const double *const g[3], double k) {
    struct span_conic *q = &item->conic;
    item->curved = true;
    q->xx = u[0] * u[0] - k * span_dot(g[0], g[0]);
    q->xy = u[0] * u[1] - k * span_dot(g[0], g[1]);
    q->yy = u[1] * u[1] - k * span_dot(g[1], g[1]);
    q->x = u[0] * u[2] - k * span_dot(g[0], g[2]);
    q->y = u[1] * u[2] - k * span_dot(g[1], g[2]);
    q->one = u[2] * u[2] - k * span_dot(g[2], g[2]);
    for (int a = 0; a < 3; a++)
        q->side[a] = u[a];
    // The rows where the quadratic in x has roots, themselves by a quadratic, and a row more on each side.
    double steep = q->xy * q->xy - q->xx * q->yy, half = q->xy * q->x - q->xx * q->y;
    double rest = half * half - steep * (q->x * q->x - q->xx * q->one);
    if (q->xx < 0 && steep < 0 && rest > 0) {
        double root = sqrt(rest), scale = 0.5 / frame->per_pixel;
        double middle = 0.5 * (frame->height - 1) + half / steep * scale;
        item->top = middle + root / steep * scale - 1;
        item->bottom = middle - root / steep * scale + 1;
    }
}

static inline void set_empty(struct span_item *item, const struct fused_frame *frame) {
    static const double right[3] = {1, 0, 0}, left[3] = {-1, 0, 0};
    add_side(item, frame, right, -2 * frame->reach[0] - 1);
    add_side(item, frame, left, -2 * frame->reach[0] - 1);
}

// The outline of a sphere of this radius, `to` from the eye. With the eye within: all, or, if it is sure, nothing.
static inline void set_sphere(struct span_item *item, const struct fused_frame *frame,
                              const double to[3], double radius) {
    double u[3], k = span_dot(to, to) - radius * radius;
    for (int a = 0; a < 3; a++)
        u[a] = span_dot(to, frame->axis[a]);
    if (k > 0 && radius > 0)
        set_conic(item, frame, u,
                  (const double *[]){frame->axis[0], frame->axis[1], frame->axis[2]}, k);
    else if (item->bit / 16 == ROLE_SURE / 16)
        set_empty(item, frame);
}

// A local direction in camera axes.
static inline void in_camera(const struct fused_frame *frame, const struct primitive *s,
                             const double local[3], double to[3]) {
    double world[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++)
        span_along(world, s->row[k], local[k], world);
    for (int k = 0; k < 3; k++)
        to[k] = span_dot(world, frame->axis[k]);
}

// Cuts by a half-space through the eye. n: in the solid's frame.
static inline void cut_from_eye(struct span_item *item, const struct fused_frame *frame,
                                const struct primitive *s, const double n[3], double share) {
    double to[3];
    in_camera(frame, s, n, to);
    add_side(item, frame, to, share * ANGLE_ERROR * frame->reach[2] * sqrt(span_dot(n, n)));
}

// Whether the hull is on one side of a plane through `at`, up to rounding.
static inline bool holds_hull(const struct span_hull *hull, const double at[3], const double n[3]) {
    double unit[3], zero[3] = {0, 0, 0}, length = sqrt(span_dot(n, n));
    span_along(zero, n, 1 / length, unit);
    return length > 0 && span_support(hull, unit) <= span_dot(unit, at) + 1e-12 * hull->bound;
}

// The planes through the eye that touch both rims of a cone: exact, where its sides are the outline.
static inline void cut_by_cone(struct span_item *item, const struct fused_frame *frame,
                               const struct span_hull *hull, const double at[3]) {
    const struct primitive *s = hull->shape;
    double slope = (s->b - s->a) / (2.0 * s->c), w = 0.5 * (s->a + s->b) + slope * at[1];
    double square = at[0] * at[0] + at[2] * at[2], rest = square - w * w;
    for (int side = -1; side <= 1 && rest > 0; side += 2) {
        double root = side * sqrt(rest);
        double n[3] = {(at[0] * w - at[2] * root) / square, -slope,
                       (at[2] * w + at[0] * root) / square};
        if (holds_hull(hull, at, n))
            cut_from_eye(item, frame, s, n, 1);
    }
}

// The outline of a solid: `may` by tangents, or by edges if they are all of the outline; `sure` by the polygon of
// points where the tangents touch, if it goes about the centre.
static inline void set_outline(struct span_item *may, struct span_item *sure,
                               const struct fused_frame *frame, const struct span_hull *hull,
                               const struct span_source *eye) {
    const struct primitive *s = hull->shape;
    struct span_tangents t;
    double edge[TANGENTS][3], ahead[3];
    bool exact = s->type == SHAPE_BOX || s->type == SHAPE_OCTAHEDRON, corner[TANGENTS], any = false;
    set_tangents(hull, eye, &t);
    for (int k = 0; k < 3; k++)
        ahead[k] = span_dot(s->row[k], frame->axis[2]);
    for (int k = 0; k < TANGENTS && t.touch; k++) {
        double from[3], to[3];
        span_along(t.point[k], eye->at, -1, from);
        span_along(t.point[(k + 1) % TANGENTS], eye->at, -1, to);
        span_cross(to, from, edge[k]);
        corner[k] = span_dot(edge[k], edge[k]) > 1e-24 * span_dot(from, from) * span_dot(to, to);
        any = any || corner[k];
        t.touch = span_dot(from, ahead) > 1e-3 * eye->far &&
                  (!corner[k] || span_dot(edge[k], eye->at) > 0);
        exact = exact && (!corner[k] || holds_hull(hull, eye->at, edge[k]));
    }
    t.touch = t.touch && any;
    exact = exact && t.touch;
    for (int k = 0; k < TANGENTS; k++) {
        if (t.touch && corner[k]) {
            cut_from_eye(sure, frame, s, edge[k], -4);
            if (exact)
                cut_from_eye(may, frame, s, edge[k], 1);
        }
        if (!exact && t.found[k])
            cut_from_eye(may, frame, s, t.m[k], 1);
    }
    if (!t.touch)
        set_empty(sure, frame);
    if (s->type == SHAPE_CONE)
        cut_by_cone(may, frame, hull, eye->at);
}

// The rows that may meet the outline of a ball. The item stays as it is otherwise.
static inline void set_ball_rows(struct span_item *item, const struct fused_frame *frame,
                                 const double to[3], double radius) {
    set_sphere(item, frame, to, radius * (1 + ANGLE_ERROR) + ANGLE_ERROR * sqrt(span_dot(to, to)));
    item->curved = false;
}

// Where a sphere can darken a plane: the cone between it and the ball of light, cut by the plane. to: from the light.
static inline void set_dark_cone(struct span_item *item, const struct fused_frame *frame,
                                 const struct plane_seen *plane, const double to[3], double r,
                                 double ball) {
    double far = sqrt(span_dot(to, to)), sine = (r + ball) / far, apex[3], u[3], g[3][3];
    if (!(sine < 1))
        return;
    span_along(frame->eye, frame->light, -1, apex);
    span_along(apex, to, -ball / (r + ball), apex); // from the apex to the eye
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < 3; j++)
            g[k][j] = plane->height * frame->axis[k][j] + plane->fall[k] * apex[j];
        u[k] = span_dot(to, g[k]) / far;
    }
    u[2] += 2 * (plane->height + sqrt(span_dot(apex, apex))) * ANGLE_ERROR * frame->reach[2];
    set_conic(item, frame, u, (const double *[]){g[0], g[1], g[2]}, 1 - sine * sine);
}

// The same for any solid, by half-spaces between it and the ball of light.
static inline void set_dark_sides(struct span_item *item, const struct fused_frame *frame,
                                  const struct plane_seen *plane, const struct span_hull *hull,
                                  const struct span_source *light) {
    const struct primitive *s = hull->shape;
    double from[3], at[3];
    span_along(frame->eye, s->centre, -1, from);
    for (int k = 0; k < 3; k++)
        at[k] = span_dot(s->row[k], from);
    struct span_tangents t;
    set_tangents(hull, light, &t);
    for (int k = 0; k < TANGENTS; k++) {
        if (!t.found[k])
            continue;
        double out = span_dot(t.m[k], at) - span_support(hull, t.m[k]), n[3];
        in_camera(frame, s, t.m[k], n);
        for (int j = 0; j < 3; j++)
            n[j] = plane->height * n[j] + out * plane->fall[j];
        add_side(item, frame, n, ANGLE_ERROR * frame->reach[2] * sqrt(span_dot(n, n)));
    }
}

// The outline of a solid in a plane's mirror; the hull is larger by what float may err. eye: the eye's mirror image.
static inline void set_reflected(struct span_item *item, const struct fused_frame *frame,
                                 const double normal[3], const struct span_hull *hull,
                                 const struct span_source *eye) {
    const struct primitive *s = hull->shape;
    struct span_tangents t;
    double local[3];
    set_tangents(hull, eye, &t);
    for (int k = 0; k < 3; k++)
        local[k] = span_dot(s->row[k], normal);
    for (int k = 0; k < TANGENTS; k++) {
        double m[3];
        span_along(t.m[k], local, -2 * span_dot(t.m[k], local), m);
        if (t.found[k])
            cut_from_eye(item, frame, s, m, 0);
    }
}
