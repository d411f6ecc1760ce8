// First hits of the Mandelbulb, proved by balls: J. C. Hart, D. J. Sandin, L. H. Kauffman, "Ray tracing deterministic
// 3-D fractals", SIGGRAPH 1989, for the map's Lipschitz bound; here it is the Jacobian's norm over a ball.
#include "bulb/bulb_hit.h"

enum { MOST_BALLS = 200000 };
static const double WIDEST =
    0x1p-32; // of a bracket, as a share of the distances that rounding goes by

// A walk along a ray: everything before `from` is on one side. If it crossed, the first crossing is from `from` to `to`.
struct walk {
    double from, to;
    bool crossed, sure;
    long balls;
};

#define BODY "bulb/ball_body.h"
#include "number/twice.h"

static struct ray_q local_ray(const struct solid *solid, const struct ray_q *ray) {
    struct ray_q local = *ray;
    struct ivq moved[3];
    for (int i = 0; i < 3; i++)
        moved[i] = sub_q(ray->o[i], point_q(solid->shape->position[i]));
    for (int i = 0; i < 3; i++) {
        local.o[i] = solid->rotated ? dot_q(solid->rotation_q[i], moved) : moved[i];
        local.d[i] = solid->rotated ? dot_q(solid->rotation_q[i], ray->d) : ray->d[i];
    }
    return local;
}

// Returns on which side the ray starts; 0: not decided.
static int start_of(const struct shape *shape, const struct ray_q *local) {
    struct line_d rough = line_of_d(local);
    int side = segment_side_d(shape, &rough, 0, 0);
    if (side == 0) {
        struct line_q fine = line_of_q(local);
        side = segment_side_q(shape, &fine, 0, 0);
    }
    return side;
}

// Walks in doubles, and from where they do not decide in quads.
static struct walk walk_ray(const struct shape *shape, const struct ray_q *local, double reach,
                            int from_side) {
    struct walk walk = {0};
    struct line_d rough = line_of_d(local);
    walk_d(shape, &rough, reach, from_side, &walk);
    if (!walk.sure) {
        struct line_q fine = line_of_q(local);
        walk_q(shape, &fine, reach, from_side, &walk);
    }
    return walk;
}

static bool starts_in_solid(const struct prepared *prepared, const struct ray_q *ray) {
    struct dd o[3];
    for (int i = 0; i < 3; i++)
        o[i] = dd_from_quad(mid_q(ray->o[i]));
    for (int i = 0; i < prepared->model.shape_count; i++)
        if (!is_fractal(prepared->model.shapes[i].type) &&
            distance_to(&prepared->solids[i], o).hi < 1e-20)
            return true;
    return false;
}

void first_bulb(const struct prepared *prepared, const struct ray_q *ray, struct ivq reach,
                struct hit *hit) {
    const struct hit solids = *hit;
    double limit = double_above(solids.shape >= 0 ? solids.s.hi : reach.hi);
    bool sure = solids.status == PROVED, crossed = false;
    int inside = 0, bulbs = 0;
    for (int i = 0; i < prepared->model.shape_count; i++) {
        const struct solid *solid = &prepared->solids[i];
        if (solid->shape->type != SHAPE_MANDELBULB || solid->duplicate)
            continue;
        struct ray_q local = local_ray(solid, ray);
        int side = start_of(solid->shape, &local);
        struct walk walk = walk_ray(solid->shape, &local, limit, side < 0 ? -1 : 1);
        hit->evals += walk.balls;
        inside += side < 0;
        bulbs++;
        sure = sure && side != 0 && walk.sure;
        if (walk.sure && !walk.crossed)
            continue;
        // Whichever is second must begin behind the end of the first.
        sure = sure && (hit->shape < 0 || walk.to < hit->s.lo || walk.from > hit->s.hi);
        if (walk.crossed) {
            hit->shape = i;
            hit->face = FACE_NONE;
            hit->s = (struct ivq){walk.from, walk.to};
            hit->normal_sure = crossed = true;
            limit = walk.to;
        }
    }
    // A ray that starts inside of a shape hits where it leaves the union. That is known only of one Mandelbulb with all
    // else behind it, and of solids with no Mandelbulb before.
    if (inside && (bulbs > 1 || (solids.shape >= 0 && !(hit->s.hi < solids.s.lo))))
        sure = false;
    if (crossed && (starts_in_solid(prepared, ray) || hit->s.hi > reach.lo))
        sure = false;
    hit->status = sure ? PROVED : UNDECIDED;
}

bool bulb_blocks(const struct prepared *prepared, const struct ray_q *ray, double reach,
                 enum status *status) {
    bool blocked = false, sure = true;
    for (int i = 0; i < prepared->model.shape_count && !blocked; i++) {
        const struct solid *solid = &prepared->solids[i];
        if (solid->shape->type != SHAPE_MANDELBULB || solid->duplicate)
            continue;
        struct ray_q local = local_ray(solid, ray);
        int side = start_of(solid->shape, &local);
        struct walk walk = {.sure = true};
        if (side > 0)
            walk = walk_ray(solid->shape, &local, reach, 1);
        blocked = side < 0 || walk.crossed;
        sure = sure && side != 0 && walk.sure;
    }
    if (!sure && !blocked)
        *status = UNDECIDED;
    return blocked;
}

void bulb_normal(const struct solid *solid, const struct ivq point[3], double n[3]) {
    const struct shape *shape = solid->shape;
    const quad step = (quad)0x1p-36;
    struct ray_q at = {.o = {point[0], point[1], point[2]}};
    struct ray_q local = local_ray(solid, &at);
    quad p[3], slope[3], length;
    for (int i = 0; i < 3; i++) {
        p[i] = mid_q(local.o[i]);
        double cell = shape->repeat[i];
        if (cell > 0)
            p[i] -= (quad)floor((double)(p[i] / cell) + 0.5) * cell;
    }
    for (int i = 0; i < 3; i++) {
        quad norm[2];
        for (int j = 0; j < 2; j++) {
            quad c[3] = {p[0], p[1], p[2]};
            c[i] += j ? step : -step;
            quad z[3] = {c[0], c[1], c[2]};
            for (int k = 0; k < shape->mandelbulb.iterations; k++)
                bulb_power_q(z, c);
            norm[j] = z[0] * z[0] + z[1] * z[1] + z[2] * z[2];
        }
        slope[i] = norm[1] - norm[0];
    }
    length = length_q(slope);
    for (int i = 0; i < 3; i++) {
        quad x = 0;
        for (int j = 0; j < 3; j++)
            x += (solid->rotated ? mid_q(solid->rotation_q[j][i]) : (quad)(i == j)) * slope[j];
        n[i] = (double)(x / length);
    }
}
