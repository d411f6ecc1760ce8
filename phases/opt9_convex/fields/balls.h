// The balls of a union's children: which of them a packet's rays meet, and the program of these alone.
#pragma once

#include "fields/rays.h"
#include "groups/program.h"
#include "simd/simd.h"

static inline struct vec in_group(const struct field *f, struct vec p) {
    return (struct vec){p.x + v_splat(f->centre[0]), p.y + v_splat(f->centre[1]),
                        p.z + v_splat(f->centre[2])};
}

// A tube about the live rays of a packet: `wide` about its axis from `near` to `far`.
struct beam {
    struct vec o, d; // the same in all lanes
    vfloat wide, near, far;
};

static inline vfloat of_lane(vfloat a, int lane) {
    if (lane == 0)
        return v_splat(v_lane0(a));
    float lanes[LANES];
    v_store(a, lanes);
    return v_splat(lanes[lane]);
}

// Returns which of the points are no farther than that from the first, which is one of them.
static inline vmask points_near(struct vec p, vmask active, float within) {
    unsigned bits = v_mask_bits(active);
    int lane = bits ? __builtin_ctz(bits) : 0;
    struct vec first = {of_lane(p.x, lane), of_lane(p.y, lane), of_lane(p.z, lane)};
    struct vec off = vec_sub(p, first);
    return v_andnot(v_cmp_gt(vec_dot(off, off), v_splat(within * within)), active);
}

// Sets the part of the rays that counts.
static inline void clip_beam(struct beam *b, vmask active, vfloat near, vfloat far) {
    vfloat none = v_splat(-INFINITY);
    b->far = v_max_of_lanes(v_select(active, far, none));
    b->near = v_splat(0.0f) - v_max_of_lanes(v_select(active, v_splat(0.0f) - near, none));
}

static inline struct beam beam_of(struct vec o, struct vec d, vmask active, vfloat near,
                                  vfloat far) {
    unsigned bits = v_mask_bits(active);
    int lane = bits ? __builtin_ctz(bits) : 0;
    struct beam b = {.o = {of_lane(o.x, lane), of_lane(o.y, lane), of_lane(o.z, lane)},
                     .d = {of_lane(d.x, lane), of_lane(d.y, lane), of_lane(d.z, lane)}};
    clip_beam(&b, active, near, far);
    struct vec off = vec_sub(o, b.o), turn = vec_sub(d, b.d);
    vfloat most = v_max(v_abs(b.near), v_abs(b.far));
    vfloat wide = v_madd(v_sqrt(vec_dot(turn, turn)), most, v_sqrt(vec_dot(off, off)));
    b.wide = v_max_of_lanes(v_select_or_zero(active, wide));
    return b;
}

// Returns the beam that is a ball about the points.
static inline struct beam ball_about(struct vec p, vmask active) {
    unsigned bits = v_mask_bits(active);
    int lane = bits ? __builtin_ctz(bits) : 0;
    vfloat zero = v_splat(0.0f);
    struct beam b = {.o = {of_lane(p.x, lane), of_lane(p.y, lane), of_lane(p.z, lane)},
                     .d = {zero, zero, zero},
                     .near = zero,
                     .far = zero};
    struct vec off = vec_sub(p, b.o);
    b.wide = v_sqrt(v_max_of_lanes(v_select_or_zero(active, vec_dot(off, off))));
    return b;
}

// Returns which of the spheres i to i + LANES − 1, `more` larger, a cone of slope q about a ray of the beam may meet.
static inline vmask spheres_in_beam(const struct sphere_array *s, int i, const struct beam *b,
                                    float q, float more) {
    vfloat reach = v_madd(v_splat(1.5f), b->wide, v_splat(more));
    struct vec v =
        vec_sub((struct vec){v_load(s->x + i), v_load(s->y + i), v_load(s->z + i)}, b->o);
    vfloat along = vec_dot(v, b->d);
    vfloat square = v_max(v_nmadd(along, along, vec_dot(v, v)), v_splat(0.0f));
    vfloat t = along; // where a cone is nearest to the centre, it is upright on its side
    if (q > 0)
        t = v_madd(v_sqrt(square), v_splat(q / sqrtf(1 - q * q)), along);
    t = v_min(v_max(t, b->near), b->far);
    vfloat room = v_load(s->radius + i) + v_madd(v_splat(q), t, reach);
    vmask in = v_cmp_lt(v_madd(t - along, t - along, square), room * room);
    return v_and(in, v_mask_first(s->count - i < LANES ? s->count - i : LANES));
}

// Lists the balls, `more` larger, that a cone of slope q about a ray of the beam may meet. Returns their number.
static inline int list_balls(const struct field *f, const struct beam *b, float q, float more,
                             int *list) {
    const struct sphere_array *balls = &f->balls.level[0], *nodes = &f->balls.level[1];
    int count = 0, of_nodes = f->balls.levels > 1 ? nodes->count : 1;
    for (int k = 0; k < of_nodes; k += LANES) {
        unsigned in = f->balls.levels > 1 ? v_mask_bits(spheres_in_beam(nodes, k, b, q, more)) : 1;
        for (; in; in &= in - 1) {
            int i = (k + __builtin_ctz(in)) * BVH_WIDTH, end = i + BVH_WIDTH;
            for (; i < end && i < balls->count; i += LANES) {
                vmask met = spheres_in_beam(balls, i, b, q, more);
                v_compress_store_lanes(met, i, 0, list + count);
                count += v_count(met);
            }
        }
    }
    return count;
}

// Returns how much larger balls need be if only `count` children have a part: less than 0. A blend of n spheres drops by
// k/2·(1 − 1/n) at most.
static inline float less_drop(const struct field *f, int count) {
    float all = (float)f->balls.level[0].count;
    return count > 0 ? 0.5f * f->blend * (1 / all - 1 / (float)count) : 0.0f;
}

static inline struct vec ball_centre(const struct field *f, int i) {
    const struct sphere_array *balls = &f->balls.level[0];
    return (struct vec){v_splat(balls->x[i]), v_splat(balls->y[i]), v_splat(balls->z[i])};
}

// The span of a ball, `more` larger.
static inline struct cone_span ball_span(const struct field *f, int i, float more, struct vec o,
                                         struct vec d, vfloat q) {
    vfloat radius = v_splat(f->balls.level[0].radius[i] + more);
    return cone_span(vec_sub(ball_centre(f, i), o), radius, d, q);
}

// Returns the program of the listed children alone. room: as many steps as the whole has.
static inline struct program part_of(const struct field *f, int *list, int count,
                                     struct step *room) {
    const struct program *whole = f->program;
    for (int i = 0; i < count; i++) { // in their order: the first of equals decides the material
        int child = f->balls.shape[list[i]], k = i;
        for (; k > 0 && list[k - 1] > child; k--)
            list[k] = list[k - 1];
        list[k] = child;
    }
    struct program part = *whole;
    part.steps = room;
    part.length = 0;
    for (int i = 0; i < count; i++)
        for (int k = f->first[list[i]]; k < f->first[list[i] + 1]; k++)
            room[part.length++] = whole->steps[k];
    if (count > 1) {
        room[part.length] = whole->steps[whole->length - 1];
        room[part.length++].count = (short)count;
    }
    return part;
}

// Returns how far f stays above 0: the root of excess + (secant − bend·step/2)·x − bend·x²/2. Here f is `excess`. It has
// risen at slope `secant` over the last `step`, and bends down by no more than `bend`.
static inline vfloat bent_step(vfloat excess, vfloat secant, vfloat step, float bend) {
    vfloat slope = v_nmadd(v_splat(0.5f * bend), step, secant), zero = v_splat(0.0f);
    vfloat root = v_sqrt(v_max(v_madd(slope, slope, v_splat(2 * bend) * excess), zero));
    return v_select(v_cmp_gt(slope, zero), (slope + root) * v_splat(1 / bend),
                    (excess + excess) / v_max(root - slope, v_splat(1e-12f)));
}
