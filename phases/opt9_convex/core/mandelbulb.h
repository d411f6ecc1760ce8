// The Mandelbulb's distance for a whole packet: D. White and P. Nylander's power-8 map in its trigonometry-free form
// with the running derivative (I. Quilez, "mandelbulb", iquilezles.org/articles/mandelbulb). An estimate, not a bound.
// Included by core/shape_distances.h.
#pragma once

// The map in the form of phase opt2. Lanes that have escaped, or whose ray is done, keep their values (the
// paper's Fig. 5).
static inline vfloat sdf_mandelbulb(struct vec p, const struct primitive *s, vmask live) {
    vfloat x = p.x, y = p.y, z = p.z, m = vec_dot(p, p), dz = v_splat(1.5f);
    // |p|^16 overflows from |p| = 256 on. From 32 on, the estimate equals r·ln(r)/3 to a float's precision.
    vmask far = v_cmp_gt(m, v_splat(1024.0f)), escaped = v_or(v_not(live), far);
    for (int i = 0; i < s->iterations; i++) {
        vfloat x2 = x * x, y2 = y * y, z2 = z * z;
        vfloat k3 = x2 + z2, k4 = k3 - y2;
        vfloat per_k3 =
            v_select_or_zero(v_cmp_gt(k3, v_splat(1e-36f)), v_splat(1.0f) / k3); // 0 on the axis
        vfloat k1 = v_madd(k3, k3, y2 * v_nmadd(v_splat(6.0f), k3, y2));
        vfloat cos2 = (x2 - z2) * per_k3, sin2 = v_splat(2.0f) * (x * z) * per_k3;
        vfloat cos4 = v_nmadd(sin2 + sin2, sin2, v_splat(1.0f)), sin4 = (sin2 + sin2) * cos2;
        vfloat k2 = v_splat(8.0f) * y * k4 * k1 * v_sqrt(k3), k2_sin4 = k2 * (sin4 + sin4);
        x = v_madd(k2_sin4, cos4, p.x);      // p.x + k2·sin8
        z = v_madd(k2_sin4, sin4, p.z - k2); // p.z − k2·cos8
        y = v_madd(k1, k1, v_nmadd(v_splat(16.0f) * y2 * k3, k4 * k4, p.y));
        vfloat slope = v_madd(v_splat(8.0f) * (m * m * m * v_sqrt(m)), dz,
                              v_splat(1.0f)); // its root can wait until now
        vfloat grown = v_madd(x, x, v_madd(y, y, z * z));
        m = v_select(escaped, m, grown);
        dz = v_select(escaped, dz, slope);
        escaped = v_or(escaped, v_cmp_gt(m, v_splat(s->bailout)));
        if (v_all(escaped))
            break;
    }
    vfloat distance =
        v_splat(0.25f) * v_sqrt(m) / dz * v_log(m); // the division beside the logarithm
    if (v_any(far)) {
        vfloat r = v_sqrt(vec_dot(p, p));
        distance = v_select(far, r * v_log(r) * v_splat(1.0f / 3.0f), distance);
    }
    return v_select_or_zero(v_cmp_gt(m, v_splat(0.0f)), distance); // √m·ln m → 0 at the centre
}
