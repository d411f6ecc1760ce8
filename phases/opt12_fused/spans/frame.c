// A frame's regions: outlines of solids, what is seen of planes, and where on them solids can darken or be mirrored.
#include <math.h>

#include "scene/scene.h"
#include "spans/regions.h"
#include "spans/spans.h"
#include "types/known_scene.h"

// Solids are this much larger, of the scene's bounds, for rays that start on a surface: float knows points, directions
// and ratios no better (PROOFS.md, 7.).
#define POINT_ERROR 0x1p-20

// The outline of solid i as seen from the eye, in the picture.
static void add_outline(struct fused_frame *frame, int i) {
    const struct primitive *s = &frame->shape[i];
    struct span_item *may = new_item(frame, ROLE_MAY + i), *sure = new_item(frame, ROLE_SURE + i);
    double to[3], at[3];
    span_along(s->centre, frame->eye, -1, to);
    double far = sqrt(span_dot(to, to));
    if (s->type == SHAPE_SPHERE) {
        set_sphere(may, frame, to, s->bound * (1 + ANGLE_ERROR) + ANGLE_ERROR * far);
        set_sphere(sure, frame, to, s->bound * (1 - 4 * ANGLE_ERROR) - 4 * ANGLE_ERROR * far);
        return;
    }
    for (int k = 0; k < 3; k++)
        at[k] = -span_dot(s->row[k], to);
    struct span_hull hull = {s, s->bound, 0};
    struct span_source eye = source_at(at, 0);
    set_outline(may, sure, frame, &hull, &eye);
    set_ball_rows(may, frame, to, s->bound);
    sure->top = may->top;
    sure->bottom = may->bottom;
}

// Adds where plane i is seen within the bounds and no other plane is nearer.
static void add_plane(struct fused_frame *frame, int i) {
    struct plane_seen here = plane_from(frame, i, frame->eye);
    double most = ANGLE_ERROR * frame->reach[2], bounds = frame->bounds_radius;
    for (int sure = 0; sure < 2; sure++) {
        struct span_item *item = new_item(frame, (sure ? ROLE_SURE : ROLE_MAY) + i);
        double u[3], p[3][3];
        for (int k = 0; k < 3; k++) {
            u[k] = bounds * here.fall[k];
            for (int j = 0; j < 3; j++)
                p[k][j] = here.height * frame->axis[k][j] + here.fall[k] * frame->eye[j];
        }
        u[2] += (sure ? -4 : 4) * bounds * most;
        set_conic(item, frame, u, (const double *[]){p[0], p[1], p[2]}, 1);
        for (int j = 0; j < frame->shapes; j++) {
            if (j == i || !(frame->planes >> j & 1))
                continue;
            struct plane_seen there = plane_from(frame, j, frame->eye);
            double later[3]; // positive where plane j is nearer
            for (int k = 0; k < 3; k++)
                later[k] = here.height * there.fall[k] - there.height * here.fall[k];
            add_side(item, frame, later, (sure ? -1 : 1) * (here.height + there.height) * most);
        }
    }
}

// The circle on a plane around the points that a ball of radius r at `to` from the light can darken. ball: what they see
// through a cone of the frame's slope, the light with slope·(their greatest distance from it) as its radius.
struct dark_circle {
    bool none;
    double centre[3], radius;
};

static struct dark_circle circle_of(const struct fused_frame *frame, const struct plane_seen *plane,
                                    const double to[3], double r, double ball) {
    struct dark_circle c = {false, {0, 0, 0}, INFINITY};
    double far = sqrt(span_dot(to, to)), sine = (r + ball) / far;
    if (!(sine < 1))
        return c;
    double share = ball / (r + ball),
           height = plane->light_height + span_dot(plane->normal, to) * share;
    double down = -span_dot(plane->normal, to) / far, level = sqrt(fmax(1 - down * down, 0));
    double cosine = sqrt(1 - sine * sine);
    double low = down * cosine - level * sine, high = down * cosine + level * sine;
    c.none = height > 0 ? high <= 0 : low >= 0; // no direction of the cone leads to the plane
    if (c.none || height <= 0 || low <= 1e-6)
        return c;
    double from = (level * cosine - down * sine) / high, end = (level * cosine + down * sine) / low;
    c.radius = 0.5 * height * (end - from) * (1 + POINT_ERROR); // float knows its rim no better
    for (int k = 0; k < 3; k++) {
        double flat = level > 1e-9 ? (to[k] / far + plane->normal[k] * down) / level : 0;
        c.centre[k] = frame->light[k] + to[k] * share - plane->normal[k] * height +
                      flat * 0.5 * height * (end + from);
    }
    return c;
}

// Adds where solid j can darken plane i: a region of the picture, and a circle on the plane.
static void add_dark(struct fused_frame *frame, int i, int j) {
    const struct primitive *s = &frame->shape[j];
    struct plane_seen plane = plane_from(frame, i, frame->eye);
    double to[3], foot[3], grow = POINT_ERROR * frame->bounds_radius;
    span_along(s->centre, frame->light, -1, to);
    span_along(frame->light, plane.normal, -plane.light_height - plane.offset, foot);
    double wide = frame->bounds_radius * frame->bounds_radius - plane.offset * plane.offset;
    double aside = sqrt(span_dot(foot, foot)) + sqrt(fmax(wide, 0)), ball = 0;
    struct dark_circle circle = {0};
    for (int step = 0; step < 3;
         step++) { // a darkened point is in the circle, so no further off than its rim
        ball = frame->slope * sqrt(plane.light_height * plane.light_height + aside * aside);
        circle = circle_of(frame, &plane, to, s->bound + grow, ball);
        double apart[3];
        span_along(circle.centre, frame->light, -1, apart);
        span_along(apart, plane.normal, plane.light_height, apart);
        aside = fmin(aside, sqrt(span_dot(apart, apart)) + circle.radius);
    }
    if (circle.none || plane.light_height <= 0)
        return;
    struct dark_region *region = &frame->dark[frame->dark_count++];
    *region = (struct dark_region){.solid = j, .plane = i};
    for (int k = 0; k < 3; k++)
        region->centre[k] = (float)circle.centre[k];
    region->radius_sq = (float)(circle.radius * circle.radius);
    struct span_item *item = new_item(frame, ROLE_DARK + j);
    set_dark_cone(item, frame, &plane, to, s->bound + grow, ball);
    if (s->type == SHAPE_SPHERE)
        return;
    item->curved = false; // its rows count
    double at[3];
    for (int k = 0; k < 3; k++)
        at[k] = -span_dot(s->row[k], to);
    struct span_hull hull = {s, s->bound, grow};
    struct span_source light = source_at(at, ball);
    set_dark_sides(item, frame, &plane, &hull, &light);
}

// Adds where the mirror rays of plane i may meet solid j: its outline as seen from the eye's mirror image.
static void add_reflected(struct fused_frame *frame, int i, int j, double offset) {
    const struct primitive *s = &frame->shape[j];
    struct plane_seen plane = plane_from(frame, i, frame->eye);
    double image[3], to[3], at[3], grow = POINT_ERROR * frame->bounds_radius;
    span_along(frame->eye, plane.normal, offset - 2 * plane.height, image);
    span_along(s->centre, image, -1, to);
    double far = sqrt(span_dot(to, to));
    struct span_item *item = new_item(frame, ROLE_REFLECTED + j);
    for (int k = 0; k < 3; k++)
        at[k] = -span_dot(s->row[k], to);
    if (far <= s->bound + grow)
        return; // the image is within: no bound
    struct span_hull hull = {s, s->bound, grow};
    struct span_source eye = source_at(at, 0);
    set_reflected(item, frame, plane.normal, &hull, &eye);
    span_along(to, plane.normal, -2 * span_dot(to, plane.normal), at);
    set_ball_rows(item, frame, at, s->bound + grow);
}

// Sets the shapes that solid j may darken, by balls about them.
static void set_pairs(struct fused_frame *frame, int j) {
    const struct primitive *s = &frame->shape[j];
    double to[3], grow = POINT_ERROR * frame->bounds_radius, r = s->bound + grow;
    span_along(s->centre, frame->light, -1, to);
    double far = sqrt(span_dot(to, to));
    for (int i = 0; i < frame->shapes; i++) {
        const struct primitive *p = &frame->shape[i];
        if (i == j || (frame->planes >> i & 1)) {
            frame->pair[i] |= (uint64_t)(i != j) << j;
            continue;
        }
        double from[3], from_light[3];
        span_along(p->centre, frame->light, -1, from_light);
        double other = p->bound + grow,
               ball = frame->slope * (sqrt(span_dot(from_light, from_light)) + other);
        double sine = (r + ball) / far;
        bool may = !(sine < 1);
        if (!may) {
            span_along(from_light, to, -ball / (r + ball), from); // from the cone's apex
            double along = span_dot(from, to) / far;
            double across = sqrt(fmax(span_dot(from, from) - along * along, 0));
            may = across * sqrt(1 - sine * sine) - along * sine <= other;
        }
        frame->pair[i] |= (uint64_t)may << j;
    }
}

// The greatest n·p of all solids that a mirror ray of i may meet: not i, if it is convex.
static double top_of_others(const struct fused_frame *frame, int i, const double n[3]) {
    double top = -INFINITY, local[3];
    for (int j = 0; j < frame->shapes; j++) {
        const struct primitive *s = &frame->shape[j];
        if ((j == i && s->convex) || !(frame->solids >> j & 1))
            continue;
        for (int a = 0; a < 3; a++)
            local[a] = span_dot(s->row[a], n);
        struct span_hull hull = {s, s->bound, 0};
        top = fmax(top, span_dot(n, s->centre) + span_support(&hull, local));
    }
    return top;
}

enum { MIRRORED = 3 * TANGENTS };

// Sets some mirror rays of a ball, spread over what the eye sees of it.
static void set_mirrored(const struct fused_frame *frame, const struct primitive *s,
                         double o[MIRRORED][3], double d[MIRRORED][3]) {
    double at[3], m[3];
    span_along(frame->eye, s->centre, -1, at);
    struct span_source eye = source_at(at, 0);
    for (int k = 0; k < MIRRORED; k++) {
        double sine = 0.4 + 0.25 * (k / TANGENTS), cosine = sqrt(1 - sine * sine);
        for (int a = 0; a < 3; a++)
            m[a] = -cosine * eye.axis[a] +
                   sine * (span_turn(k) * eye.side[a] + span_turn(k + 12) * eye.up[a]);
        span_along(s->centre, m, s->bound, o[k]);
        span_along(o[k], frame->eye, -1, d[k]);
        span_along(d[k], m, -2 * span_dot(d[k], m), d[k]);
    }
}

// Sets the guards of mirror i: of the axes and the planes' normals those that clear most rays.
static void set_guards(struct fused_frame *frame, int i) {
    uint64_t done = 0, cleared[6 + SPAN_SHAPES];
    double top[6 + SPAN_SHAPES], n[6 + SPAN_SHAPES][3] = {{0}}, o[MIRRORED][3], d[MIRRORED][3];
    set_mirrored(frame, &frame->shape[i], o, d);
    for (int k = 0; k < 6 + frame->shapes; k++) {
        cleared[k] = 0;
        if (k < 6)
            n[k][k / 2] = k % 2 ? 1 : -1;
        else if (frame->planes >> (k - 6) & 1)
            span_along(n[k], frame->shape[k - 6].row[0], 1, n[k]);
        else
            continue;
        top[k] = top_of_others(frame, i, n[k]);
        for (int r = 0; r < MIRRORED; r++)
            cleared[k] |= (uint64_t)(span_dot(n[k], o[r]) >= top[k] && span_dot(n[k], d[r]) >= 0)
                          << r;
    }
    for (int g = 0; g < SPAN_GUARDS; g++) {
        int best = 0;
        for (int k = 1; k < 6 + frame->shapes; k++)
            if (__builtin_popcountll(cleared[k] & ~done) >
                __builtin_popcountll(cleared[best] & ~done))
                best = k;
        bool some = (cleared[best] & ~done) != 0;
        done |= cleared[best];
        frame->guard_top[i][g] =
            some ? (float)(top[best] + POINT_ERROR * frame->bounds_radius) : INFINITY;
        for (int a = 0; a < 3; a++)
            frame->guard[i][g][a] = (float)n[best][a];
    }
}

static void set_view(const struct known_scene *scene, const struct view *view, int width,
                     int height, int grain, struct fused_frame *frame) {
    frame->width = width;
    frame->height = height;
    frame->grain = grain;
    frame->per_pixel = view->tan_half_fov / height;
    for (int k = 0; k < 3; k++) {
        frame->eye[k] = view->position[k];
        frame->axis[0][k] = view->right[k];
        frame->axis[1][k] = view->up[k];
        frame->axis[2][k] = view->forward[k];
        frame->light[k] = view->light_position[k];
        frame->emission[k] = view->light_emission[k];
    }
    double x = width * frame->per_pixel, y = view->tan_half_fov;
    frame->reach[0] = x;
    frame->reach[1] = y;
    frame->reach[2] = sqrt(1 + x * x + y * y);
    frame->bounds_radius = scene->model.march.bounds_radius;
    frame->fog = scene->model.fog;
    frame->slope = scene->model.shadows == SHADOWS_NONE ? 1e-5 : 1 / scene->model.shadow_strength;
}

// Sorts the shapes into planes and solids. Returns false if spans cannot draw one of them.
static bool set_shapes(const struct known_scene *scene, struct fused_frame *frame) {
    frame->shapes = scene->model.shape_count;
    frame->shape = scene->primitives;
    for (int i = 0; i < frame->shapes; i++) {
        const struct primitive *s = &frame->shape[i];
        double far = sqrt(span_dot(s->centre, s->centre)) + s->bound;
        if (s->eval == EVAL_LINEAR)
            frame->planes |= (uint64_t)1 << i;
        else if (s->repeated || !(s->bound > 0) || !(far < frame->bounds_radius * (1 - 1e-4)))
            return false;
        else
            frame->solids |= (uint64_t)1 << i;
    }
    return true;
}

// Whether solid j is above plane i, so that a ray from above meets it first. It may touch the plane.
static bool is_above(const struct fused_frame *frame, int i, int j) {
    const struct primitive *plane = &frame->shape[i], *s = &frame->shape[j];
    double local[3], apart[3];
    for (int k = 0; k < 3; k++)
        local[k] = -span_dot(s->row[k], plane->row[0]);
    span_along(s->centre, plane->centre, -1, apart);
    struct span_hull hull = {s, s->bound, 0};
    return span_dot(plane->row[0], apart) - span_support(&hull, local) >
           plane->offset - 1e-6 * s->bound;
}

KERNEL_SHARED bool fused_frame_set(const struct known_scene *scene, const struct view *view,
                                   int width, int height, int grain, struct fused_frame *frame) {
    int count = scene->model.shape_count;
    bool shadows = scene->model.shadows != SHADOWS_NONE;
    frame->shapes = frame->items = frame->dark_count = 0;
    frame->planes = frame->solids = frame->above = 0;
    if (count > SPAN_SHAPES || (width + grain - 1) / grain > SPAN_GROUPS)
        return false;
    set_view(scene, view, width, height, grain, frame);
    if (!set_shapes(scene, frame))
        return false;
    int planes = __builtin_popcountll(frame->planes), solids = count - planes;
    if (2 * count + 2 * planes * solids > SPAN_ITEMS || planes * solids > SPAN_DARK)
        return false;
    frame->above = frame->solids;
    for (int i = 0; i < count; i++) {
        frame->pair[i] = 0;
        frame->mirror[i] = (frame->planes | frame->solids) & ~((uint64_t)1 << i);
        if (!frame->shape[i].convex && !(frame->planes >> i & 1))
            frame->mirror[i] |= (uint64_t)1 << i;
    }
    for (int i = 0; i < count; i++) {
        if (frame->solids >> i & 1) {
            add_outline(frame, i);
            if (shadows)
                set_pairs(frame, i);
            if (frame->shape[i].share > 0)
                set_guards(frame, i);
            continue;
        }
        add_plane(frame, i);
        for (int j = 0; j < count; j++) {
            if (!(frame->solids >> j & 1))
                continue;
            if (!is_above(frame, i, j))
                frame->above &= ~((uint64_t)1 << j);
            if (shadows)
                add_dark(frame, i, j);
            if (frame->shape[i].share > 0)
                add_reflected(frame, i, j, scene->model.march.surface_offset);
        }
    }
    return true;
}
