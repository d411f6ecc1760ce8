// Gradients of solids in closed form, in the shape's axes, as opt4 and opt6_wide take them. They need not be of unit length.
// The phase's vectors come before it.
#pragma once

static inline struct vec box_gradient(struct vec p, const real half_size[3]) {
    vreal zero = v_splat(0.0f);
    vreal x = v_abs(p.x) - v_splat(half_size[0]);
    vreal y = v_abs(p.y) - v_splat(half_size[1]);
    vreal z = v_abs(p.z) - v_splat(half_size[2]);
    vreal most = v_max(x, v_max(y, z));
    // Outside: away from the nearest point. Inside: along the axis of the nearest face.
    vmask outside = v_cmp_gt(most, zero), on_x = v_cmp_ge(x, most), on_y = v_cmp_ge(y, most);
    vreal one = v_splat(1.0f);
    struct vec face = {v_select_or_zero(on_x, one), v_select_or_zero(v_andnot(on_x, on_y), one),
                       v_zero_where(v_or(on_x, on_y), one)};
    struct vec away = {v_max(x, zero), v_max(y, zero), v_max(z, zero)};
    struct vec g = vec_select(outside, away, face);
    return (struct vec){v_copysign(g.x, p.x), v_copysign(g.y, p.y), v_copysign(g.z, p.z)};
}

static inline struct vec torus_gradient(struct vec p, real major_radius) {
    vreal radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vreal outward = v_splat(1.0f) - v_splat(major_radius) / v_max(radius, v_splat(1e-30f));
    return (struct vec){p.x * outward, p.y, p.z * outward};
}

static inline struct vec cone_gradient(struct vec p, real bottom, real top, real half_height,
                                       const real side[2], real inv_side_sq) {
    vreal zero = v_splat(0.0f);
    vreal radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    vreal x = radius - v_splat(top), y = p.y - v_splat(half_height);
    vreal rim = v_select(v_cmp_lt(p.y, zero), v_splat(bottom), v_splat(top));
    vreal cap_x = v_max(radius - rim, zero), cap_y = v_abs(p.y) - v_splat(half_height);
    vreal across = v_madd(x, v_splat(side[0]), y * v_splat(side[1])) * v_splat(-inv_side_sq);
    vreal along = v_min(v_max(across, zero), v_splat(1.0f));
    vreal side_x = v_madd(v_splat(side[0]), along, x);
    vreal side_y = v_madd(v_splat(side[1]), along, y);
    // Beside the slope, the slope's normal is used: for a point on it, the vector to it is mostly rounding.
    vmask beside = v_and(v_cmp_gt(across, zero), v_cmp_lt(across, v_splat(1.0f)));
    vreal out = v_select(beside, v_splat(side[1]), side_x),
          up = v_select(beside, v_splat(-side[0]), side_y);
    vmask cap =
        v_cmp_lt(v_madd(cap_x, cap_x, cap_y * cap_y), v_madd(side_x, side_x, side_y * side_y));
    vmask past = v_cmp_gt(cap_x, zero);
    cap = v_andnot(v_and(past, v_cmp_lt(cap_y, zero)), cap); // beside the rim both are one point
    vreal cap_up = v_select(past, cap_y, v_splat(1.0f));     // over the cap: straight up
    out = v_select(cap, cap_x, out);
    up = v_select(cap, v_copysign(cap_up, p.y), up);
    vreal per_radius = out / v_max(radius, v_splat(1e-30f));
    return (struct vec){p.x * per_radius, up, p.z * per_radius};
}

static inline struct vec octahedron_gradient(struct vec p) {
    vreal one = v_splat(1.0f);
    return (struct vec){v_copysign(one, p.x), v_copysign(one, p.y), v_copysign(one, p.z)};
}

// Returns a closed form, or the difference of distances over `step` where it differs by more than its noise: within a step
// of an edge. p: the point in the shape's frame. linear: a plane, whose own difference is the closed form, but for hits in
// `near` of another shape.
static inline struct vec closed_or_difference(struct vec exact, struct vec rounded, struct vec p,
                                              float step, bool linear, vmask near) {
    rounded = vec_scale(rounded, v_splat(1.0f / step));
    struct vec apart = vec_along(rounded, exact, v_splat(-1.0f));
    vreal size = v_max(v_abs(p.x), v_max(v_abs(p.y), v_abs(p.z)));
    vreal noise =
        v_madd(size, v_splat(0x1p-20f / step), v_splat(1e-3f)); // 16 half ulps, and curvature
    vmask edge =
        v_and(v_cmp_gt(vec_dot(apart, apart), noise * noise), v_cmp_lt(noise, v_splat(0.5f)));
    if (linear)
        edge = v_and(edge, near);
    return vec_select(edge, rounded, exact);
}

// Returns the unit normals, on the side of the incoming ray; 0 in lanes that are not `found`. away: the gradient is on the
// other side. slope: how fast the distance falls along the ray where the gradient is a closed form, of unit length. A
// difference, at an edge or through a thin plate, is no slope to divide by: 1e30.
static inline struct vec normal_of(struct vec gradient, struct vec direction, vmask found,
                                   vmask *away, vreal *slope) {
    vreal length = vec_norm(gradient);
    vreal along = vec_dot(direction, gradient);
    *slope = v_select(v_cmp_lt(v_abs(length - v_splat(1.0f)), v_splat(1e-4f)), v_abs(along),
                      v_splat(1e30f));
    *away = v_cmp_gt(along, v_splat(0.0f));
    struct vec n = vec_scale(gradient, v_negate_where(*away, v_splat(1.0f) / length));
    // Without a direction, as at a centre, the normal points back along the ray. 1e-18: its square is a normal float.
    vmask clear = v_and(v_cmp_gt(length, v_splat(1e-18f)), v_cmp_lt(length, v_splat(1e18f)));
    n = vec_select(clear, n, vec_scale(direction, v_splat(-1.0f)));
    return (struct vec){v_select_or_zero(found, n.x), v_select_or_zero(found, n.y),
                        v_select_or_zero(found, n.z)};
}
