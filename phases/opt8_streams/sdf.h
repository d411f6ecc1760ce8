// Signed distances of as many points at once as there are lanes. Sphere, box, torus, capped cone, octahedron: I. Quilez,
// "distance functions" (iquilezles.org/articles/distfunctions). Mandelbulb: D. White and
// P. Nylander's power-8 map in its trigonometry-free form with the running derivative, I. Quilez,
// "mandelbulb" (iquilezles.org/articles/mandelbulb); it is an estimate, not a bound.
//
// In float, a point at |p| = 20 is known to 1e-6, the scene's hit distance. So nothing is evaluated
// in world coordinates: each ray holds, for each shape, its origin and direction in that shape's
// own frame, and the march evaluates origin + t·direction there, rounded once at the size of the
// shape. Branches that differ between lanes are evaluated for all and chosen by mask.
#ifndef OPT6_SDF_H
#define OPT6_SDF_H

#include "placed.h"
#include "simd/point.h"
#include "simd/pow.h"

// Rays in the frame of one shape. LINEAR: the distance is origin.x + t·direction.x. POWER:
// |p|² − radius² is power + t·(t + slope).
struct approach {
    struct vec origin, direction;
    vfloat power, slope;
};

// Packets under way together, one instruction of each after the other: the chain of operations through a step
// is several times as long as it takes to issue them. They share the questions, too: a shape that one of
// them needs is evaluated for all.
enum { GROUP = 4 };

// A packet of rays under way. `high` + t is no less than the distance to the nearest steady shape.
struct beam {
    struct approach *approach; // one per shape
    struct list list;          // those that its rays can meet: the same for all of a group
    // One per shape, GROUP apart: the shape is not the nearest as long as this is above (distance to the
    // nearest) + t.
    vfloat *wake;
    vfloat high;
};

static inline struct vec turned(const struct placed *placed, struct vec v) {
    COUNT(turned, call);
    if (!placed->turned)
        return v;
    COUNT(turned, rotation);
    return (struct vec){vec_dot(vec_set(placed->turn[0]), v), vec_dot(vec_set(placed->turn[1]), v),
                        vec_dot(vec_set(placed->turn[2]), v)};
}

// Back from the shape's frame: the matrix is orthogonal, so its transpose.
static inline struct vec turned_back(const struct placed *placed, struct vec v) {
    COUNT(turned_back, call);
    if (!placed->turned)
        return v;
    COUNT(turned_back, rotation);
    struct vec out = vec_scale(vec_set(placed->turn[0]), v.x);
    out = vec_along(out, vec_set(placed->turn[1]), v.y);
    return vec_along(out, vec_set(placed->turn[2]), v.z);
}

static inline vfloat wrapped(vfloat x, float cell, float per_cell) { // cell 0: not repeated
    return v_nmadd(v_splat(cell), v_floor(v_madd(x, v_splat(per_cell), v_splat(0.5f))), x);
}

static inline struct vec vec_wrapped(const struct placed *placed, struct vec p) {
    COUNT(vec_wrapped, call);
    return (struct vec){wrapped(p.x, placed->cell[0], placed->per_cell[0]),
                        wrapped(p.y, placed->cell[1], placed->per_cell[1]),
                        wrapped(p.z, placed->cell[2], placed->per_cell[2])};
}

static inline vdouble v_double_wrapped(vdouble x, double cell, double per_cell) {
    vdouble turns = v_double_floor(v_double_sub(v_double_mul(x, per_cell), -0.5));
    return v_double_madd(turns, -cell, x);
}

// One coordinate in the shape's frame. It cancels: a place 5 from a turned box has a face's distance
// to 5e-7 by a product of floats, which is the hit distance; and in the 10,000th cell to 4e-3.
static inline vfloat coordinate(const struct placed *placed, struct vec_double from, int axis) {
    COUNT(coordinate, call);
    vdouble x = v_double_sub(v_double_dot(from, placed->row[axis]), placed->offset);
    if (placed->repeated) {
        COUNT(coordinate, wrap);
        x = v_double_wrapped(x, placed->wide_cell[axis], placed->wide_per_cell[axis]);
    }
    return v_double_to_float(x);
}

static inline vfloat power_at(struct vec_double from, double square) {
    COUNT(power_at, call);
    struct vec_double p = from;
    vhalf each = v_half_splat(square);
    return v_double_to_float(
        (vdouble){p.x.low * p.x.low + p.y.low * p.y.low + p.z.low * p.z.low - each,
                  p.x.high * p.x.high + p.y.high * p.y.high + p.z.high * p.z.high - each});
}

// Fills one approach per shape: where the rays are, and then where they go.
static inline void approach_origins(struct point origin, const struct prepared *scene,
                                    struct beam *beam) {
    COUNT(approach_origins, call);
    struct approach *approach = beam->approach;
    beam->high = v_splat(INFINITY);
    struct vec_double at = vec_double_of(origin);
    for (int place = 0; place < beam->list.count; place++) {
        int i = beam->list.shape[place];
        const struct placed *placed = &scene->placed[i];
        beam->wake[i * GROUP] = v_splat(-INFINITY);
        if (placed->way == AT_POINT && !placed->turned && !placed->repeated) {
            approach[i].origin = point_sub(origin, placed->position, placed->position_lo);
            continue;
        }
        struct vec_double from = vec_double_sub(at, placed->centre);
        approach[i].origin.x = coordinate(placed, from, 0);
        if (placed->way == LINEAR)
            continue;
        approach[i].origin.y = coordinate(placed, from, 1);
        approach[i].origin.z = coordinate(placed, from, 2);
        if (placed->way == POWER)
            approach[i].power = power_at(from, placed->radius_sq);
    }
}

static inline void approach_directions(struct vec direction, const struct prepared *scene,
                                       const struct beam *beam) {
    COUNT(approach_directions, call);
    struct approach *approach = beam->approach;
    for (int place = 0; place < beam->list.count; place++) {
        int i = beam->list.shape[place];
        const struct placed *placed = &scene->placed[i];
        if (placed->way == LINEAR) {
            COUNT(approach_directions, linear);
            approach[i].direction.x = vec_dot(vec_set(placed->normal), direction);
            continue;
        }
        approach[i].direction = turned(placed, direction);
        if (placed->way == POWER) {
            COUNT(approach_directions, power);
            approach[i].slope = v_splat(2.0f) * vec_dot(approach[i].origin, approach[i].direction);
        }
    }
}

static inline vfloat sdf_sphere(struct vec p, const struct placed *s) {
    COUNT(sdf_sphere, call);
    return vec_norm(p) - v_splat(s->a);
}

// |p| − a from |p|² − a². The difference of two numbers of a planet's size would be lost.
static inline vfloat sdf_power(vfloat power, const struct placed *s) {
    COUNT(sdf_power, call);
    return power / (v_sqrt(v_max(power + v_splat(s->b), v_splat(0.0f))) + v_splat(s->a));
}

static inline vfloat sdf_plane(struct vec p, const struct placed *s) {
    COUNT(sdf_plane, call);
    return vec_dot(p, vec_set(s->size)) - v_splat(s->a);
}

static inline vfloat sdf_box(struct vec p, const struct placed *s) {
    COUNT(sdf_box, call);
    vfloat zero = v_splat(0.0f);
    vfloat x = v_abs(p.x) - v_splat(s->size[0]);
    vfloat y = v_abs(p.y) - v_splat(s->size[1]);
    vfloat z = v_abs(p.z) - v_splat(s->size[2]);
    struct vec outside = {v_max(x, zero), v_max(y, zero), v_max(z, zero)};
    return vec_norm(outside) + v_min(v_max(x, v_max(y, z)), zero);
}

static inline vfloat sdf_rounded_box(struct vec p, const struct placed *s) {
    COUNT(sdf_rounded_box, call);
    return sdf_box(p, s) - v_splat(s->a);
}

static inline vfloat sdf_torus(struct vec p, const struct placed *s) {
    COUNT(sdf_torus, call);
    vfloat ring = v_sqrt(v_madd(p.x, p.x, p.z * p.z)) - v_splat(s->a);
    return v_sqrt(v_madd(ring, ring, p.y * p.y)) - v_splat(s->b);
}

static inline vfloat sdf_cone(struct vec p, const struct placed *s) {
    COUNT(sdf_cone, call);
    vfloat zero = v_splat(0.0f), one = v_splat(1.0f);
    vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vfloat x = radius - v_splat(s->b), y = p.y - v_splat(s->c); // from the top rim
    vfloat rim = v_select(v_cmp_lt(p.y, zero), v_splat(s->a), v_splat(s->b));
    vfloat cap_x = v_max(radius - rim, zero), cap_y = v_abs(p.y) - v_splat(s->c);
    vfloat across = v_madd(x, v_splat(s->slope[0]), y * v_splat(s->slope[1]));
    vfloat along = v_min(v_max(across * v_splat(-s->per_slope_sq), zero), one);
    vfloat side_x = v_madd(v_splat(s->slope[0]), along, x);
    vfloat side_y = v_madd(v_splat(s->slope[1]), along, y);
    vmask inside = v_and(v_signbit(side_x), v_signbit(cap_y));
    vfloat square =
        v_min(v_madd(cap_x, cap_x, cap_y * cap_y), v_madd(side_x, side_x, side_y * side_y));
    return v_negate_where(inside, v_sqrt(square));
}

static inline vfloat sdf_octahedron(struct vec point, const struct placed *s) {
    COUNT(sdf_octahedron, call);
    vfloat x = v_abs(point.x), y = v_abs(point.y), z = v_abs(point.z);
    vfloat zero = v_splat(0.0f), radius = v_splat(s->a);
    vfloat m = x + y + z - radius, third = m * v_splat(1.0f / 3.0f);
    vmask over_yz = v_cmp_lt(x, third), over_zx = v_cmp_lt(y, third), over_xy = v_cmp_lt(z, third);
    vfloat face = m * v_splat(0.57735026918962576451f); // 1/√3
    vmask edges = v_or(over_yz, v_or(over_zx, over_xy));
    if (!v_any(edges))
        return face;
    COUNT(sdf_octahedron, edges);
    vfloat a = v_select(over_yz, x, v_select(over_zx, y, z));
    vfloat b = v_select(over_yz, y, v_select(over_zx, z, x));
    vfloat c = v_select(over_yz, z, v_select(over_zx, x, y));
    vfloat k = v_min(v_max(v_splat(0.5f) * (c - b + radius), zero), radius);
    vfloat beside = b - radius + k, above = c - k;
    vfloat edge = v_sqrt(v_madd(a, a, v_madd(beside, beside, above * above)));
    return v_select(edges, edge, face);
}

// The map in the form of phase opt2. Lanes that have escaped, or whose ray is done, keep what they
// have (the paper's Fig. 5).
struct bulb {
    struct vec p, w;
    vfloat m, dz;
    vmask far, inside;
};

static inline struct bulb bulb_start(struct vec p, vmask live) {
    COUNT(bulb_start, call);
    // |w|² becomes |p|^16, which overflows from |p| = 256 on; from 32 on the estimate is r·ln(r)/3
    // to a float's precision, after the one iteration that escapes.
    vfloat m = vec_dot(p, p);
    vmask far = v_cmp_gt(m, v_splat(1024.0f));
    return (struct bulb){p, p, m, v_splat(1.5f), far, v_andnot(far, live)};
}

static inline void bulb_iterate(struct bulb *b, vfloat bailout) {
    ACTIVE(v_count(b->inside));
    COUNT(bulb_iterate, call);
    vfloat x = b->w.x, y = b->w.y, z = b->w.z, m = b->m;
    vfloat x2 = x * x, y2 = y * y, z2 = z * z;
    vfloat k3 = x2 + z2, k4 = k3 - y2;
    vfloat per_k3 =
        v_select_or_zero(v_cmp_gt(k3, v_splat(1e-36f)), v_splat(1.0f) / k3); // 0 on the axis
    vfloat k1 = v_madd(k3, k3, y2 * v_nmadd(v_splat(6.0f), k3, y2));
    vfloat cos2 = (x2 - z2) * per_k3, sin2 = v_splat(2.0f) * (x * z) * per_k3;
    vfloat cos4 = v_nmadd(sin2 + sin2, sin2, v_splat(1.0f)), sin4 = (sin2 + sin2) * cos2;
    vfloat k2 = v_splat(8.0f) * y * k4 * k1 * v_sqrt(k3), k2_sin4 = k2 * (sin4 + sin4);
    x = v_madd(k2_sin4, cos4, b->p.x);      // p.x + k2·sin8
    z = v_madd(k2_sin4, sin4, b->p.z - k2); // p.z − k2·cos8
    y = v_madd(k1, k1, v_nmadd(v_splat(16.0f) * y2 * k3, k4 * k4, b->p.y));
    vfloat slope = v_madd(v_splat(8.0f) * (m * m * m * v_sqrt(m)), b->dz, v_splat(1.0f));
    vfloat grown = v_madd(x, x, v_madd(y, y, z * z));
    b->w = (struct vec){x, y, z};
    b->m = v_select(b->inside, grown, m);
    b->dz = v_select(b->inside, slope, b->dz);
    b->inside = v_cmp_ngt_in(b->inside, b->m, bailout);
}

static inline vfloat bulb_estimate(const struct bulb *b) {
    COUNT(bulb_estimate, call);
    // r·ln(r)/3 is √m·ln(m)/6.
    vfloat per = v_select(b->far, v_splat(1.0f / 6.0f), v_splat(0.25f) / b->dz);
    vfloat distance = v_sqrt(b->m) * per * v_log(b->m);
    return v_select_or_zero(v_cmp_gt(b->m, v_splat(0.0f)), distance); // √m·ln m → 0 at the centre
}

static inline vfloat sdf_mandelbulb(struct vec p, const struct placed *s, vmask live) {
    COUNT(sdf_mandelbulb, call);
    struct bulb bulb = bulb_start(p, live);
    for (int i = 0; i < s->iterations; i++) {
        bulb_iterate(&bulb, v_splat(s->bailout));
        if (!v_any(bulb.inside))
            break;
    }
    ACTIVE(v_count(live));
    return bulb_estimate(&bulb);
}

// What the estimate is not less than from a place at distance √square from the centre on, as long as that
// falls no faster than t grows. Beyond r = 3/2 the first iteration ends at w ≥ r⁸ − r, so that the estimate,
// ½·w·ln(w)/(12·r⁷ + 1) and hardly less by further iterations, is over 0.18 + (r − 3/2)/2.
static inline vfloat bulb_wakes_at(vfloat square, vfloat t) {
    COUNT(bulb_wakes_at, call);
    vfloat out = v_sqrt_below(square) - v_splat(1.5f);
    vfloat bound = v_min(out, v_madd(out, v_splat(0.5f), v_splat(0.18f)));
    return v_madd(v_splat(1.0f - 0x1p-10f), bound, t);
}

// At a point of the shape's own frame, wrapped if it is repeated. What way and type are is known where it
// is inlined in all_distances().
__attribute__((always_inline)) static inline vfloat
distance_at(struct vec p, const struct placed *placed, enum shape_type type, vmask live) {
    switch (type) {
    case SHAPE_SPHERE: return sdf_sphere(p, placed);
    case SHAPE_BOX: return sdf_box(p, placed);
    case SHAPE_TORUS: return sdf_torus(p, placed);
    case SHAPE_CONE: return sdf_cone(p, placed);
    case SHAPE_OCTAHEDRON: return sdf_octahedron(p, placed);
    case SHAPE_PLANE: return sdf_plane(p, placed);
    case SHAPE_ROUNDED_BOX: return sdf_rounded_box(p, placed);
    default: return sdf_mandelbulb(p, placed, live);
    }
}

// Distance to one shape at distance t along the rays.
__attribute__((always_inline)) static inline vfloat
distance_to_shape(const struct approach *a, vfloat t, const struct placed *placed, bool repeated,
                  enum way way, enum shape_type type, vmask live) {
    COUNT(distance_to_shape, call);
    if (way == POWER) {
        COUNT(distance_to_shape, power);
        return sdf_power(v_madd(t, t + a->slope, a->power), placed);
    }
    if (way == LINEAR) {
        COUNT(distance_to_shape, linear);
        return v_madd(t, a->direction.x, a->origin.x);
    }
    COUNT(distance_to_shape, point);
    struct vec p = vec_along(a->origin, a->direction, t);
    if (repeated)
        p = vec_wrapped(placed, p);
    return distance_at(p, placed, type, live);
}

// Distance to the nearest shape at distance t along the rays, and which one it is (the first of equals).
static inline vfloat nearest_shape(const struct beam *beam, vfloat t, const struct prepared *scene,
                                   vmask live, vfloat *shape) {
    COUNT(nearest_shape, call);
    vfloat least = v_splat(INFINITY);
    for (int place = 0; place < beam->list.count; place++) {
        int i = beam->list.shape[place];
        COUNT(nearest_shape, shape);
        const struct placed *placed = &scene->placed[i];
        vfloat distance = distance_to_shape(&beam->approach[i], t, placed, placed->repeated,
                                            placed->way, placed->type, live);
        *shape = v_select(v_cmp_lt(distance, least), v_splat(placed->index), *shape);
        least = v_min(distance, least);
    }
    return least;
}

// The origins moved by a little along the rays.
static inline void approach_moved(vfloat by, const struct prepared *scene, struct beam *beam) {
    COUNT(approach_moved, call);
    beam->high = beam->high + v_abs(by);
    for (int place = 0; place < beam->list.count; place++) {
        int i = beam->list.shape[place];
        struct approach *a = &beam->approach[i];
        COUNT(approach_moved, first);
        beam->wake[i * GROUP] = beam->wake[i * GROUP] - v_abs(by);
        a->origin.x = v_madd(a->direction.x, by, a->origin.x);
        if (scene->placed[i].way == LINEAR)
            continue;
        COUNT(approach_moved, others);
        a->origin.y = v_madd(a->direction.y, by, a->origin.y);
        a->origin.z = v_madd(a->direction.z, by, a->origin.z);
        if (scene->placed[i].way == POWER) {
            COUNT(approach_moved, power);
            a->power = v_madd(by, by + a->slope, a->power);
        }
    }
}

// From t on: the distance to a steady shape falls no faster than t grows, so that distance + t is what no later
// distance + t can be less than. It is taken 2^-18 too small, of itself and of the shape: sixteen times what
// float makes of it, as the place in the shape's frame is no further from it than distance + t + shape.
static inline vfloat wakes_at(vfloat sum, const struct placed *placed) {
    return v_madd(sum, v_splat(1.0f - 0x1p-18f), v_splat(-placed->slack));
}

// The same from a place that may be inside.
static inline vfloat wakes_within(vfloat sum, const struct placed *placed) {
    return v_min(wakes_at(sum, placed),
                 v_madd(sum, v_splat(1.0f + 0x1p-18f), v_splat(-placed->slack)));
}

struct group {
    struct beam beam[GROUP];
    vfloat t[GROUP], distance[GROUP]; // of the last step
    vfloat high[GROUP];               // of its beam; −∞ where a ray is done: it wakes no shape
    vmask live[GROUP];
    int list[GROUP], count; // of the packets that have a live ray
};

// What scene_distances() has found so far of each packet. `limit`: distance + t of the nearest is no more.
struct found {
    vfloat least[GROUP], limit[GROUP];
};

// `steady`, `way` and `type` are known where these are inlined.
__attribute__((always_inline)) static inline void
packet_distance(struct group *group, int k, int shape, const struct placed *placed, bool steady,
                enum way way, enum shape_type type, struct found *found) {
    ACTIVE(v_count(group->live[k]));
    COUNT(packet_distance, call);
    const struct approach *a = &group->beam[k].approach[shape];
    vfloat t = group->t[k];
    vfloat distance = distance_to_shape(a, t, placed, !steady, way, type, group->live[k]);
    vfloat sum = distance + t;
    found->least[k] = v_min(distance, found->least[k]);
    found->limit[k] = v_min(sum, found->limit[k]);
    if (steady) {
        COUNT(packet_distance, steady);
        group->beam[k].wake[shape * GROUP] = wakes_at(sum, placed);
    }
}

__attribute__((always_inline)) static inline void
all_distances(struct group *group, int shape, const struct placed *placed, bool steady,
              enum way way, enum shape_type type, struct found *found) {
    if (group->count == GROUP) // unrolled
        for (int k = 0; k < GROUP; k++)
            packet_distance(group, k, shape, placed, steady, way, type, found);
    else
        for (int i = 0; i < group->count; i++)
            packet_distance(group, group->list[i], shape, placed, steady, way, type, found);
}

// An iteration of each packet after the other: one alone is a chain of a hundred cycles, and too long for the
// processor to look beyond it to the next packet.
static inline void bulb_distances(struct group *group, int shape, const struct placed *placed,
                                  struct found *found) {
    COUNT(bulb_distances, call);
    struct bulb bulb[GROUP];
    int count = group->count;
    for (int i = 0; i < count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(group->live[k]));
        COUNT(bulb_distances, packet);
        const struct approach *a = &group->beam[k].approach[shape];
        struct vec p = vec_along(a->origin, a->direction, group->t[k]);
        bulb[i] = bulb_start(placed->repeated ? vec_wrapped(placed, p) : p, group->live[k]);
        if (!placed->repeated)
            group->beam[k].wake[shape * GROUP] = bulb_wakes_at(bulb[i].m, group->t[k]);
    }
    for (int n = 0; n < placed->iterations; n++) {
        vmask inside = v_mask_none();
        for (int i = 0; i < count; i++) {
            bulb_iterate(&bulb[i], v_splat(placed->bailout));
            inside = v_or(inside, bulb[i].inside);
        }
        if (!v_any(inside))
            break;
    }
    for (int i = 0; i < count; i++) {
        int k = group->list[i];
        ACTIVE(v_count(group->live[k]));
        vfloat distance = bulb_estimate(&bulb[i]);
        found->least[k] = v_min(distance, found->least[k]);
        found->limit[k] = v_min(distance + group->t[k], found->limit[k]);
    }
}

static inline bool sleeps(const vfloat *wake, const struct found *found) {
    COUNT(sleeps, call);
    vmask awake = v_cmp_nge(wake[0], found->limit[0]);
    for (int k = 1; k < GROUP; k++)
        awake = v_or(awake, v_cmp_nge(wake[k], found->limit[k]));
    return !v_any(awake);
}

// The types told apart once for all packets.
__attribute__((always_inline)) static inline void shape_distances(struct group *group, int shape,
                                                                  const struct placed *placed,
                                                                  bool steady,
                                                                  struct found *found) {
#define EACH(way, type) all_distances(group, shape, placed, steady, way, type, found)
    if (steady && placed->way == LINEAR) {
        EACH(LINEAR, SHAPE_PLANE);
        return;
    }
    switch (placed->type) {
    case SHAPE_SPHERE:
        if (steady && placed->way == POWER)
            EACH(POWER, SHAPE_SPHERE);
        else
            EACH(AT_POINT, SHAPE_SPHERE);
        break;
    case SHAPE_BOX: EACH(AT_POINT, SHAPE_BOX); break;
    case SHAPE_TORUS: EACH(AT_POINT, SHAPE_TORUS); break;
    case SHAPE_CONE: EACH(AT_POINT, SHAPE_CONE); break;
    case SHAPE_OCTAHEDRON: EACH(AT_POINT, SHAPE_OCTAHEDRON); break;
    case SHAPE_ROUNDED_BOX: EACH(AT_POINT, SHAPE_ROUNDED_BOX); break;
    default: EACH(AT_POINT, SHAPE_PLANE); break;
    }
#undef EACH
}

// Steady shapes are no further than this in the next steps.
static inline void keep_high(struct group *group, const struct found *found) {
    COUNT(keep_high, call);
    for (int k = 0; k < GROUP; k++)
        group->high[k] = v_min(found->least[k] - group->t[k], group->high[k]);
}

// An evaluation of the scene's distance begins, of one packet. −∞ where no ray is left.
static inline void sdf(const struct group *group, int k, struct found *found) {
    ACTIVE(v_count(group->live[k]));
    COUNT(sdf, call);
    found->least[k] = v_splat(INFINITY);
    found->limit[k] = v_madd(v_splat(2.0f), group->t[k], group->high[k]);
}

// The one shape that was asked in the last step, if it was one and steady, and how long all others sleep.
struct alone {
    int shape; // −1: none, or more than one
    vfloat until[GROUP];
};

static inline void others_sleep(const struct group *group, const struct list *list,
                                struct alone *alone) {
    COUNT(others_sleep, call);
    for (int k = 0; k < GROUP; k++)
        alone->until[k] = v_splat(INFINITY);
    for (int n = 0; n < list->count; n++) {
        int i = list->order[n];
        if (i == alone->shape)
            continue;
        const vfloat *wake = &group->beam[0].wake[i * GROUP];
        for (int k = 0; k < GROUP; k++) { // no number: awake
            COUNT(others_sleep, packet);
            alone->until[k] = v_min(v_max(wake[k], v_splat(-INFINITY)), alone->until[k]);
        }
    }
}

// All shapes that may be the nearest, but `alone`, which has been asked.
static inline void all_awake(struct group *group, const struct prepared *scene, struct alone *alone,
                             struct found *found) {
    const struct list *list = &group->beam[0].list;
    int asked = alone->shape, last = asked, count = asked >= 0;
    for (int n = 0; n < list->count; n++) {
        int i = list->order[n];
        if (n == list->steady)
            keep_high(group, found);
        if (i == asked || sleeps(&group->beam[0].wake[i * GROUP], found))
            continue;
        count++;
        last = n < list->steady ? i : -1;
        const struct placed *placed = &scene->placed[i];
        if (n < list->steady)
            shape_distances(group, i, placed, true, found);
        else if (placed->type == SHAPE_MANDELBULB)
            bulb_distances(group, i, placed, found);
        else
            shape_distances(group, i, placed, false, found);
    }
    if (list->steady == list->count)
        keep_high(group, found);
    alone->shape = count == 1 ? last : -1;
    if (alone->shape >= 0)
        others_sleep(group, list, alone);
}

// Distance to the nearest shape at distance t along the rays, t never less than the last time. A steady shape
// sleeps until it may be the nearest of some ray under way: what is left out is further than what is
// returned, so that not one bit depends on it, nor on which rays share a packet. Lanes that are not
// `live` may hold anything. (To remember how far the other shapes were: saethrej/sphere-tracing, a student
// project, keeps them in a priority queue.) Of most steps one shape is all that is awake, and the next step's
// too: it is asked first, and then all others at once. Whether `alone` is formed anew.
static inline bool scene_distances(struct group *group, const struct prepared *scene,
                                   struct alone *alone) {
    struct found found;
    for (int k = 0; k < GROUP; k++)
        sdf(group, k, &found);
    if (alone->shape >= 0)
        shape_distances(group, alone->shape, &scene->placed[alone->shape], true, &found);
    bool still = alone->shape >= 0 && sleeps(alone->until, &found);
    if (still)
        keep_high(group, &found);
    else
        all_awake(group, scene, alone, &found);
    for (int k = 0; k < GROUP; k++)
        group->distance[k] = found.least[k];
    return !still;
}

#endif
