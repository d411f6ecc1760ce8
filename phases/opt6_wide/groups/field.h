// The distance to a group: its program, run for several packets by turns. The smooth minimum of a union's children is
// Σ w·d + k/2·(Σ w² − 1) at weights w = max(τ − d, 0)/k that add up to 1: A. Martins and R. Astudillo, "From softmax to
// sparsemax" (ICML 2016). τ is found by Michelot's passes (C. Michelot, J. Optim. Theory Appl. 50, 1986).
#pragma once

#include "simd/simd.h"

#include "core/shape_distances.h"
#include "groups/field_part.h"
#include "groups/program.h"

// A point in a node's frame: after position, rotation, repeat and mirror, and then twisted. `over`: its distance
// from the twist's axis less twist_inner.
struct node_point {
    struct vec q, r;
    vfloat over;
};

// Returns p in the frame of a shape, before mirrors.
static inline struct vec in_frame(struct vec p, const struct primitive *s) {
    p = turned(s, vec_sub(p, vec_set(s->position)));
    return s->repeated ? vec_wrapped(s, p) : p;
}

static inline struct vec mirrored(struct vec p, const struct group_node *n) {
    return (struct vec){n->mirror[0] ? v_abs(p.x) : p.x, n->mirror[1] ? v_abs(p.y) : p.y,
                        n->mirror[2] ? v_abs(p.z) : p.z};
}

static inline struct node_point point_in(struct vec p, const struct group_node *n) {
    struct vec q = mirrored(n->moved ? in_frame(p, &n->shape) : p, n);
    if (n->twist == 0)
        return (struct node_point){q, q, v_splat(-INFINITY)};
    vfloat off = v_sqrt(v_madd(q.x, q.x, q.z * q.z)), most = v_splat(n->twist_radius);
    vfloat in = v_select(v_cmp_gt(off, most), most / off, v_splat(1.0f));
    vfloat angle = v_splat(n->twist) * q.y, s = v_sin(angle), c = v_cos(angle);
    vfloat x = q.x * in, z = q.z * in;
    return (struct node_point){
        q, {v_msub(c, x, s * z), q.y, v_madd(s, x, c * z)}, off - v_splat(n->twist_inner)};
}

// The three sines of a node's displacement.
static inline struct vec waves(struct vec q, const struct group_node *n) {
    return (struct vec){v_sin(v_splat(n->frequency[0]) * q.x),
                        v_sin(v_splat(n->frequency[1]) * q.y),
                        v_sin(v_splat(n->frequency[2]) * q.z)};
}

// Returns a node's field from that of its shape or operation, before shell and offset.
static inline vfloat displaced(vfloat f, struct node_point at, const struct group_node *n) {
    if (n->twist != 0)
        f = v_max(f, at.over);
    if (n->amplitude > 0) {
        struct vec wave = waves(at.q, n);
        f = v_madd(v_splat(n->amplitude) * wave.x, wave.y * wave.z, f);
    }
    return f;
}

static inline vfloat shelled(vfloat f, const struct group_node *n) {
    if (n->shell > 0)
        f = v_abs(f) - v_splat(n->shell);
    return f - v_splat(n->offset);
}

static inline vfloat sdf_capsule(struct vec p, const struct primitive *s) {
    p.y = p.y - v_min(v_max(p.y, v_splat(-s->c)), v_splat(s->c));
    return vec_norm(p) - v_splat(s->a);
}

// size: 1/radii; a: the least radius.
static inline struct vec per_radius(struct vec p, const struct primitive *s) {
    return (struct vec){p.x * v_splat(s->size[0]), p.y * v_splat(s->size[1]),
                        p.z * v_splat(s->size[2])};
}

static inline vfloat sdf_ellipsoid(struct vec p, const struct primitive *s) {
    return (vec_norm(per_radius(p, s)) - v_splat(1.0f)) * v_splat(s->a);
}

// a: 2π/cell; b: cell/(2π√3); c: half of the thickness.
static inline vfloat gyroid_wave(struct vec sines, struct vec cosines) {
    return vec_dot(sines, (struct vec){cosines.y, cosines.z, cosines.x});
}

static inline void sines_of(struct vec p, float by, struct vec *sines, struct vec *cosines) {
    p = vec_scale(p, v_splat(by));
    *sines = (struct vec){v_sin(p.x), v_sin(p.y), v_sin(p.z)};
    *cosines = (struct vec){v_cos(p.x), v_cos(p.y), v_cos(p.z)};
}

static inline vfloat sdf_gyroid(struct vec p, const struct primitive *s) {
    struct vec sines, cosines;
    sines_of(p, s->a, &sines, &cosines);
    return v_msub(v_abs(gyroid_wave(sines, cosines)), v_splat(s->b), v_splat(s->c));
}

// Returns the distance of a node's shape. `type` is a constant where this is inlined.
__attribute__((always_inline)) static inline vfloat
node_distance(struct vec p, const struct primitive *s, enum shape_type type) {
    switch ((int)type) {
    case SHAPE_CAPSULE: return sdf_capsule(p, s);
    case SHAPE_ELLIPSOID: return sdf_ellipsoid(p, s);
    case SHAPE_GYROID: return sdf_gyroid(p, s);
    default: return distance_of_type(p, s, type, v_mask_all());
    }
}

// Writes (d − least)/k in place of the `n` distances of a fold, `stride` elements apart. Sets τ in these units.
// Returns the least of them.
static inline vfloat level_of(int n, int stride, vfloat *d, float per_blend, vfloat *level) {
    vfloat least = d[0], one = v_splat(1.0f), sum = v_splat(0.0f), kept = sum;
    for (int i = 1; i < n; i++)
        least = v_min(d[i * stride], least);
    for (int i = 0; i < n; i++) {
        vfloat e = d[i * stride] = (d[i * stride] - least) * v_splat(per_blend);
        vmask in = v_cmp_lt(e, one);
        sum = v_add_where(in, sum, e);
        kept = v_add_where(in, kept, one);
    }
    // The least alone: kept = 1, τ = 1. If τ rose by rounding, two lanes could go on in turns for ever.
    vfloat tau = one;
    for (;;) {
        tau = *level = v_min((one + sum) / kept, tau);
        vfloat fewer = v_splat(0.0f);
        sum = fewer;
        for (int i = 0; i < n; i++) {
            vmask in = v_cmp_lt(d[i * stride], tau);
            sum = v_add_where(in, sum, d[i * stride]);
            fewer = v_add_where(in, fewer, one);
        }
        if (!v_any(v_cmp_lt(fewer, kept)))
            return least;
        kept = fewer;
    }
}

// Returns the weight of a child, from what level_of() has written.
static inline vfloat weight_of(vfloat e, vfloat level) {
    return v_max(level - e, v_splat(0.0f));
}

// Whether a fold takes minus the distance of its child number i. The result is then negated.
static inline bool is_negated(const struct step *step, const struct group_node *n, int i) {
    return n->operation == NODE_INTERSECTION ||
           (n->operation == NODE_DIFFERENCE && step->first && i == 0);
}

static inline vfloat negated_if(bool negate, vfloat a) {
    if (negate)
        return v_splat(0.0f) - a;
    return a;
}

// Returns the result of a fold of step->count distances, `stride` elements apart, which are overwritten.
static inline vfloat folded_distance(const struct step *step, const struct group_node *n,
                                     int stride, vfloat *d) {
    int count = step->count;
    vfloat zero = v_splat(0.0f), f = v_splat(INFINITY);
    for (int i = 0; i < count && n->operation != NODE_UNION; i++)
        d[i * stride] = negated_if(is_negated(step, n, i), d[i * stride]);
    if (n->blend > 0 && count > 1) {
        vfloat level, square = zero;
        f = level_of(count, stride, d, n->per_blend, &level);
        for (int i = 0; i < count; i++) {
            vfloat w = weight_of(d[i * stride], level);
            square = v_madd(w, w, square);
        }
        vfloat half = v_splat(0.5f);
        f = v_madd(v_splat(n->blend), v_nmadd(half, square, level - half), f);
    } else
        for (int i = 0; i < count; i++)
            f = v_min(d[i * stride], f);
    return negated_if(n->operation != NODE_UNION, f);
}

// Functions with arrays of variable length pass vectors by pointers only: clang does not align their stack for others.

// Takes a point into a node's frame, as its children see it.
void enter_node(const struct group_node *n, const struct vec *p, struct vec *inside);

// Returns a node's field at p, from that of its shape or operation.
vfloat leave_node(const struct group_node *n, const struct vec *p, vfloat f);

// Sets the distances of a node's shape from `count` points.
void shape_distances(const struct step *step, const struct group_node *n, const struct vec *at,
                     int count, vfloat *distance);

// Runs a program at `count` points, at most GROUP.
void field_values(const struct program *program, const struct vec *at, int count, vfloat *result);

// Runs a program at a point for all of its parts.
struct field_part field_parts(const struct program *program, struct vec at);
