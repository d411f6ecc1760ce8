// Signed distances of the points of a packet: of four doubles in opt3, of eight floats in opt4. Sphere, box, torus,
// capped cone: I. Quilez, "distance functions" (iquilezles.org/articles/distfunctions). Mandelbox: T. Lowe
// (fractalforums.com, 2010), with the running derivative of Buddhi and Rrrola (fractalforums.com, 2010), an estimate.
//
// Included by the phase's sdf.h: its are struct primitive, and how sdf_mandelbox() is inlined.
#pragma once

static inline vreal sdf_sphere(struct vec p, const struct primitive *s) {
    COUNT(sdf_sphere, call);
    return vec_norm(p) - v_splat(s->sphere.radius);
}

static inline vreal sdf_plane(struct vec p, const struct primitive *s) {
    COUNT(sdf_plane, call);
    return vec_dot(p, vec_set(s->plane.normal)) - v_splat(s->plane.offset);
}

static inline vreal sdf_box(struct vec p, const struct primitive *s) {
    COUNT(sdf_box, call);
    vreal zero = v_splat(0.0);
    vreal x = v_abs(p.x) - v_splat(s->box.half_size[0]);
    vreal y = v_abs(p.y) - v_splat(s->box.half_size[1]);
    vreal z = v_abs(p.z) - v_splat(s->box.half_size[2]);
    struct vec outside = {v_max(x, zero), v_max(y, zero), v_max(z, zero)};
    return vec_norm(outside) + v_min(v_max(x, v_max(y, z)), zero);
}

static inline vreal sdf_rounded_box(struct vec p, const struct primitive *s) {
    COUNT(sdf_rounded_box, call);
    return sdf_box(p, s) - v_splat(s->box.rounding);
}

static inline vreal sdf_torus(struct vec p, const struct primitive *s) {
    COUNT(sdf_torus, call);
    vreal ring = v_sqrt(v_madd(p.x, p.x, p.z * p.z)) - v_splat(s->torus.major_radius);
    return v_sqrt(v_madd(ring, ring, p.y * p.y)) - v_splat(s->torus.minor_radius);
}

static inline vreal sdf_cone(struct vec p, const struct primitive *s) {
    COUNT(sdf_cone, call);
    vreal zero = v_splat(0.0), one = v_splat(1.0);
    vreal radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
    // (x, y): from the top rim.
    vreal x = radius - v_splat(s->cone.top_radius), y = p.y - v_splat(s->cone.half_height);
    vreal rim =
        v_select(v_cmp_lt(p.y, zero), v_splat(s->cone.bottom_radius), v_splat(s->cone.top_radius));
    vreal cap_x = v_max(radius - rim, zero), cap_y = v_abs(p.y) - v_splat(s->cone.half_height);
    vreal across = v_madd(x, v_splat(s->cone.side[0]), y * v_splat(s->cone.side[1]));
    vreal along = v_min(v_max(across * v_splat(-s->cone.inv_side_sq), zero), one);
    vreal side_x = v_madd(v_splat(s->cone.side[0]), along, x);
    vreal side_y = v_madd(v_splat(s->cone.side[1]), along, y);
    vmask inside = v_both_negative(side_x, cap_y);
    vreal square =
        v_min(v_madd(cap_x, cap_x, cap_y * cap_y), v_madd(side_x, side_x, side_y * side_y));
    return v_negate_where(inside, v_sqrt(square));
}

// x reflected at the nearer of ±limit where it is beyond.
static inline vreal folded(vreal x, vreal limit) {
    return v_msub(v_splat(2.0), v_min(v_max(x, -limit), limit), x);
}

// The Mandelbox's map folds the point at the planes ±fold_limit, inverts it in the sphere of fixed_radius,
// scales it and adds p. dr is the most by which the iterations stretch a distance.
static vreal sdf_mandelbox(struct vec p, const struct primitive *s) {
    COUNT(sdf_mandelbox, call);
    vreal limit = v_splat(s->mandelbox.fold_limit), outer_sq = v_splat(s->mandelbox.outer_sq);
    vreal one = v_splat(1.0), dr = one;
    struct vec w = p;
    for (int i = 0; i < s->mandelbox.iterations; i++) {
        COUNT(sdf_mandelbox, iteration);
        w = (struct vec){folded(w.x, limit), folded(w.y, limit), folded(w.z, limit)};
        vreal norm_sq = v_min(v_max(vec_dot(w, w), v_splat(s->mandelbox.inner_sq)), outer_sq);
        vreal inversion = outer_sq / norm_sq;
        w = vec_along(p, w, v_splat(s->mandelbox.scale) * inversion);
        dr = v_madd(v_splat(s->mandelbox.stretch) * inversion, dr, one);
    }
    return vec_norm(w) / dr;
}
