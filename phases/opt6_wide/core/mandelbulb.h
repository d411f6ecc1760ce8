// The Mandelbulb's distance: D. White and P. Nylander's power-8 map without trigonometry, with the running derivative
// (I. Quilez, "mandelbulb", iquilezles.org/articles/mandelbulb). An estimate, not a bound. Included by
// core/shape_distances.h.
#pragma once

// A point's orbit under the map, in the form of phase opt2. Lanes that have escaped, or whose ray is done, keep their
// values (the paper's Fig. 5).
struct bulb_orbit {
    struct vec p, w;
    vfloat m, dz;
    vmask far, inside;
};

static inline struct bulb_orbit bulb_start(struct vec p, vmask live) {
    ACTIVE(v_count(live));
    COUNT(bulb_estimate, call);
    // |w|² becomes |p|^16, which overflows from |p| = 256 on. From 32 on the estimate after the one iteration that
    // escapes is r·ln(r)/3 to a float's precision.
    vfloat m = vec_dot(p, p);
    vmask far = v_cmp_gt(m, v_splat(1024.0f));
    return (struct bulb_orbit){p, p, m, v_splat(1.5f), far, v_andnot(far, live)};
}

static inline void bulb_iterate(struct bulb_orbit *b, vfloat bailout) {
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

static inline vfloat bulb_estimate(const struct bulb_orbit *b) {
    // r·ln(r)/3 is √m·ln(m)/6.
    vfloat per = v_select(b->far, v_splat(1.0f / 6.0f), v_splat(0.25f) / b->dz);
    vfloat distance = v_sqrt(b->m) * per * v_log(b->m);
    return v_select_or_zero(v_cmp_gt(b->m, v_splat(0.0f)), distance); // √m·ln m → 0 at the centre
}

static inline vfloat sdf_mandelbulb(struct vec p, const struct primitive *s, vmask live) {
    struct bulb_orbit bulb = bulb_start(p, live);
    for (int i = 0; i < s->iterations; i++) {
        bulb_iterate(&bulb, v_splat(s->bailout));
        if (!v_any(bulb.inside))
            break;
    }
    return bulb_estimate(&bulb);
}

// Returns a lower bound of estimate + t for all later t, from a point at distance √square from the centre. The
// distance to the centre falls no faster than t grows. Beyond r = 3/2 the first iteration ends at w ≥ r⁸ − r. So the
// estimate, ½·w·ln(w)/(12·r⁷ + 1), is above 0.18 + (r − 3/2)/2, and further iterations hardly lower it.
static inline vfloat bulb_wake_bound(vfloat square, vfloat t) {
    vfloat out = v_sqrt_below(square) - v_splat(1.5f);
    vfloat bound = v_min(out, v_madd(out, v_splat(0.5f), v_splat(0.18f)));
    return v_madd(v_splat(1.0f - 0x1p-10f), bound, t);
}
