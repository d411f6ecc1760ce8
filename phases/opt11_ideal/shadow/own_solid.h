// The ratio h(t)/t of the solid on which a shadow ray starts, at a small t. The distance itself cancels in float:
// each form starts from h(0) = 0 and computes what h grows by (PROOFS.md, 5.).
#pragma once

#include "shadow/widest_cone.h"
#include "simd/simd.h"
#include "types/known_scene.h"

// How much √square grows if the square grows by `rise`. root: √square.
INLINE vfloat root_rise(vfloat rise, vfloat square, vfloat root) {
    return rise / (v_sqrt(v_max(square + rise, v_splat(0.0f))) + root);
}

// Returns |p + step| − |p|.
INLINE vfloat abs_rise(vfloat p, vfloat step) {
    vfloat same = v_negate_where(v_signbit(p), step), to = p + step;
    return v_select(v_cmp_ge(v_abs(p), v_abs(step)), same, v_abs(to) - v_abs(p));
}

INLINE vfloat own_box(struct vec p, struct vec step, const struct primitive *s) {
    vfloat zero = v_splat(0.0f), core = v_splat(core_radius(s));
    vfloat x = v_abs(p.x) - v_splat(s->size[0]), y = v_abs(p.y) - v_splat(s->size[1]);
    vfloat z = v_abs(p.z) - v_splat(s->size[2]);
    struct vec rise = {abs_rise(p.x, step.x), abs_rise(p.y, step.y), abs_rise(p.z, step.z)};
    vfloat fx = x + rise.x, fy = y + rise.y, fz = z + rise.z;
    if (!(core_radius(s) > 0.0f)) { // the face: the largest of the three is 0
        vfloat most = v_max(x, v_max(y, z));
        fx = v_select(v_cmp_ge(x, most), rise.x, fx);
        fy = v_select(v_cmp_ge(y, most), rise.y, fy);
        fz = v_select(v_cmp_ge(z, most), rise.z, fz);
        struct vec out = {v_max(fx, zero), v_max(fy, zero), v_max(fz, zero)};
        return vec_norm(out);
    }
    struct vec from = {v_max(x, zero), v_max(y, zero), v_max(z, zero)};
    rise.x = v_select(v_cmp_ge(v_min(x, fx), zero), rise.x, v_max(fx, zero) - from.x);
    rise.y = v_select(v_cmp_ge(v_min(y, fy), zero), rise.y, v_max(fy, zero) - from.y);
    rise.z = v_select(v_cmp_ge(v_min(z, fz), zero), rise.z, v_max(fz, zero) - from.z);
    vfloat grown =
        v_madd(rise.x, rise.x + from.x + from.x,
               v_madd(rise.y, rise.y + from.y + from.y, rise.z * (rise.z + from.z + from.z)));
    return root_rise(grown, core * core, core);
}

INLINE vfloat own_octahedron(struct vec p, struct vec step) {
    struct vec rise = {abs_rise(p.x, step.x), abs_rise(p.y, step.y), abs_rise(p.z, step.z)};
    vfloat x = v_abs(p.x + step.x), y = v_abs(p.y + step.y), z = v_abs(p.z + step.z);
    vfloat m = rise.x + rise.y + rise.z, low = v_min(x, v_min(y, z)), high = v_max(x, v_max(y, z));
    vfloat both = m - low, middle = x + y + z - high - low, beyond = both - middle;
    vmask face = v_cmp_le(m, v_splat(3.0f) * low), vertex = v_cmp_gt(beyond, middle);
    vfloat square =
        v_select(vertex, v_madd(beyond, beyond, middle * middle), v_splat(0.5f) * both * both);
    return v_select(face, m * v_splat(0.57735026918962576451f), v_sqrt(v_madd(low, low, square)));
}

// How much the distance from the axis grows from `radius`.
INLINE vfloat ring_rise(struct vec p, struct vec step, vfloat square, vfloat radius) {
    vfloat rise = v_madd(step.x, p.x + p.x + step.x, step.z * (p.z + p.z + step.z));
    return root_rise(rise, square, radius);
}

INLINE vfloat own_cone(struct vec p, struct vec step, const struct primitive *s) {
    vfloat zero = v_splat(0.0f);
    float per_length = sqrtf(s->per_slope_sq);
    float length = sqrtf(s->slope[0] * s->slope[0] + s->slope[1] * s->slope[1]);
    vfloat lean = v_splat(s->slope[0] * per_length), up = v_splat(s->slope[1] * per_length);
    vfloat square = v_madd(p.x, p.x, p.z * p.z), radius = v_sqrt(square);
    vfloat wider = ring_rise(p, step, square, radius);
    vfloat x = radius - v_splat(s->b), y = p.y - v_splat(s->c);
    vfloat side = v_msub(up, x, lean * y), cap = v_abs(p.y) - v_splat(s->c);
    vmask on_cap = v_cmp_gt(cap, side); // that one is 0
    vfloat across = v_zero_where(v_not(on_cap), side) + v_msub(up, wider, lean * step.y);
    vfloat out = v_zero_where(on_cap, cap) + abs_rise(p.y, step.y);
    vfloat along = v_madd(lean, x + wider, up * (y + step.y));
    vfloat past = along - v_min(v_max(along, v_splat(-length)), zero);
    vfloat rim = v_select(v_signbit(p.y), v_splat(s->a), v_splat(s->b));
    vfloat beside = v_max(radius + wider - rim, zero);
    vfloat by_side = v_sqrt(v_madd(past, past, across * across));
    vfloat by_cap = v_sqrt(v_madd(beside, beside, out * out));
    vmask over = v_and(v_cmp_gt(out, zero), v_or(on_cap, v_cmp_le(radius + wider, rim)));
    vmask within = v_and(v_cmp_le(out, zero), v_cmp_le(across, zero));
    // Beyond a cap's rim a flat side may be nearer than the rim is.
    by_cap = v_select(v_cmp_gt(beside, zero), v_min(by_cap, by_side), by_cap);
    return v_zero_where(within, v_select(over, by_cap, by_side));
}

INLINE vfloat own_torus(struct vec p, struct vec step, const struct primitive *s) {
    vfloat tube = v_splat(s->b), square = v_madd(p.x, p.x, p.z * p.z), radius = v_sqrt(square);
    vfloat wider = ring_rise(p, step, square, radius), inward = radius - v_splat(s->a);
    vfloat grown = v_madd(wider, wider + inward + inward, step.y * (step.y + p.y + p.y));
    return root_rise(grown, tube * tube, tube);
}

// Returns h(t)/t of the solid s for rays that start on it, at p in its frame, 0 if they lead into it.
INLINE vfloat own_ratio(const struct primitive *s, struct vec p, struct vec d, vfloat t) {
    vfloat zero = v_splat(0.0f);
    struct vec step = vec_scale(d, t);
    vfloat radius = v_splat(s->a), h;
    switch (s->type) {
    case SHAPE_SPHERE: {
        vfloat grown = v_madd(step.x, p.x + p.x + step.x,
                              v_madd(step.y, p.y + p.y + step.y, step.z * (p.z + p.z + step.z)));
        h = root_rise(grown, radius * radius, radius);
        break;
    }
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX: h = own_box(p, step, s); break;
    case SHAPE_OCTAHEDRON: h = own_octahedron(p, step); break;
    case SHAPE_CONE: h = own_cone(p, step, s); break;
    default: h = own_torus(p, step, s); break;
    }
    return v_max(h / t, zero);
}
