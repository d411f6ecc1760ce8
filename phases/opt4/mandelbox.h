// The Mandelbox's distance estimate. The map: T. Lowe (fractalforums.com, 2010). The running derivative:
// Buddhi and Rrrola (fractalforums.com, 2010). It is an estimate, not a bound. Included by sdf.h.
#pragma once

// x reflected at the nearer of ±limit where it is beyond.
static inline vfloat folded(vfloat x, vfloat limit) {
    return v_msub(v_splat(2.0f), v_min(v_max(x, -limit), limit), x);
}

// The Mandelbox's map folds the point at the planes ±fold_limit, inverts it in the sphere of fixed_radius,
// scales it and adds p. dr is the most by which the iterations stretch a distance.
static inline vfloat sdf_mandelbox(struct vec p, const struct primitive *s) {
    COUNT(sdf_mandelbox, call);
    vfloat limit = v_splat(s->mandelbox.fold_limit), outer_sq = v_splat(s->mandelbox.outer_sq);
    vfloat one = v_splat(1.0f), dr = one;
    struct vec w = p;
    for (int i = 0; i < s->mandelbox.iterations; i++) {
        COUNT(sdf_mandelbox, iteration);
        w = (struct vec){folded(w.x, limit), folded(w.y, limit), folded(w.z, limit)};
        vfloat norm_sq = v_min(v_max(vec_dot(w, w), v_splat(s->mandelbox.inner_sq)), outer_sq);
        vfloat inversion = outer_sq / norm_sq;
        w = vec_along(p, w, v_splat(s->mandelbox.scale) * inversion);
        dr = v_madd(v_splat(s->mandelbox.stretch) * inversion, dr, one);
    }
    return vec_norm(w) / dr;
}
