// The blend of a union of plain spheres, without its program: its field and that field's slope along the rays.
// fields/balls.h comes before it.
#pragma once

enum { MOST_SPHERES = 48 };

// bend: further along the ray the field is nowhere below f + slope·x − bend·x²/2. No distance is below its tangent, and
// the blend of the tangents bends down by Σ (slope − mean)²/k at most: PROOFS.md, 13.
struct field_along {
    vfloat f, slope, bend;
};

// The blend of two distances: least − (k − |a − b|)²/4k where that is not negative (I. Quilez, "smooth minimum").
static inline struct field_along blend_of_two(const vfloat *d, const vfloat *slope, float k,
                                              float per_k) {
    vfloat low = v_min(d[0], d[1]), high = v_max(d[0], d[1]);
    vmask first = v_cmp_le(d[0], d[1]);
    vfloat weight = v_max(v_nmadd(high - low, v_splat(0.5f * per_k), v_splat(0.5f)), v_splat(0.0f));
    vfloat of_low = v_select(first, slope[0], slope[1]), of_high = slope[0] + slope[1] - of_low;
    vfloat apart = of_high - of_low;
    return (struct field_along){v_nmadd(weight * weight, v_splat(k), low),
                                v_madd(weight, apart, of_low),
                                apart * apart * v_splat(0.5f * per_k)};
}

// Returns τ for the distances e above the least, in units of k: Michelot's passes, from all that are below 1. A quotient of
// few bits will do: the derivative of the blend by τ is k·(1 − Σ w) = 0.
__attribute__((always_inline)) static inline vfloat level_near(const vfloat *e, int count) {
    vfloat one = v_splat(1.0f), level = one, kept = v_splat((float)count + 1);
    for (;;) {
        vfloat sum = one, in_level = v_splat(0.0f);
        for (int i = 0; i < count; i++) {
            vmask in = v_cmp_lt(e[i], level);
            sum = v_add_where(in, sum, e[i]);
            in_level = v_add_where(in, in_level, one);
        }
        if (!v_any(v_cmp_lt(in_level, kept)))
            return level;
        kept = in_level;
        level = v_min(sum * v_rcp_approx(kept), level); // rounding alone would raise it, for ever
    }
}

// Returns τ of two to four distances, where Σ max(τ − d, 0) = k. A part of that sum is no more than all of it. So τ is
// the least of the means (k + Σ d)/n of the n nearest.
__attribute__((always_inline)) static inline vfloat level_of_few(const vfloat *d, int count,
                                                                 vfloat blend) {
    vfloat low = v_min(d[0], d[1]), high = v_max(d[0], d[1]), part = v_splat(1.0f / 3);
    if (count == 2)
        return v_min(low + blend, v_splat(0.5f) * (d[0] + d[1] + blend));
    vfloat least = v_min(low, d[2]), three = d[0] + d[1] + d[2], two = three - v_max(high, d[2]);
    vfloat all = three;
    if (count == 4) {
        vfloat low2 = v_min(d[2], d[3]), high2 = v_max(d[2], d[3]);
        all = three + d[3];
        three = all - v_max(high, high2);
        least = v_min(low, low2);
        two = least + v_min(v_max(low, low2), v_min(high, high2));
    }
    vfloat level = v_min(least + blend, v_splat(0.5f) * (two + blend));
    level = v_min(level, part * (three + blend));
    if (count == 4)
        level = v_min(level, v_splat(0.25f) * (all + blend));
    return level;
}

// A ball as a ray sees it: how far along the ray its centre is, and how far from the ray, squared.
struct met_ball {
    vfloat along, square;
    int ball;
};

static inline struct met_ball met_by(const struct field *f, int i, struct vec o, struct vec d) {
    struct vec v = vec_sub(ball_centre(f, i), o);
    vfloat along = vec_dot(v, d);
    struct vec aside = vec_along(v, d, v_splat(0.0f) - along);
    return (struct met_ball){along, vec_dot(aside, aside), i};
}

// Returns the blend of 1 to MOST_SPHERES distances. `count` is a constant where this is inlined with one.
__attribute__((always_inline)) static inline struct field_along
blend_of(const struct field *field, const vfloat *distance, const vfloat *slope, int count) {
    if (count == 2)
        return blend_of_two(distance, slope, field->blend, field->per_blend);
    vfloat blend = v_splat(field->blend), level, zero = v_splat(0.0f);
    if (count == 3 || count == 4) {
        level = level_of_few(distance, count, blend);
    } else {
        vfloat least = distance[0], above[MOST_SPHERES];
        for (int i = 1; i < count; i++)
            least = v_min(distance[i], least);
        for (int i = 0; i < count; i++)
            above[i] = (distance[i] - least) * v_splat(field->per_blend);
        level = v_madd(level_near(above, count), blend, least);
    }
    vfloat weights = zero, along = zero, sum = zero, squares = zero;
    for (int i = 0; i < count; i++) {
        vfloat w = v_max(level - distance[i], zero);
        weights = v_madd(w, w, weights);
        along = v_madd(w, slope[i], along);
        sum = sum + slope[i];
        squares = v_madd(slope[i], slope[i], squares);
    }
    vfloat per = v_splat(field->per_blend),
           spread = v_nmadd(sum * v_splat(1.0f / (float)count), sum, squares);
    vfloat f =
        v_nmadd(weights, v_splat(0.5f * field->per_blend), level - v_splat(0.5f * field->blend));
    return (struct field_along){f, along * per, spread * per};
}

// Returns the blend of spheres at t along their ray.
__attribute__((always_inline)) static inline struct field_along
blend_at(const struct field *field, const struct met_ball *met, int count, vfloat t) {
    vfloat distance[MOST_SPHERES], slope[MOST_SPHERES];
    if (count < 1)
        __builtin_unreachable();
    for (int i = 0; i < count; i++) {
        COUNT(group_shape, call);
        vfloat x = t - met[i].along, square = v_max(v_madd(x, x, met[i].square), v_splat(1e-30f)),
               per = v_rsqrt_newton(square);
        distance[i] = v_msub(square, per, v_splat(field->sphere[met[i].ball]));
        slope[i] = x * per;
    }
    return blend_of(field, distance, slope, count);
}

// The same; a count that is known has straight-line code.
__attribute__((always_inline)) static inline struct field_along
blend_along(const struct field *field, const struct met_ball *met, int count, vfloat t) {
    switch (count) {
    case 2: return blend_at(field, met, 2, t);
    case 3: return blend_at(field, met, 3, t);
    case 4: return blend_at(field, met, 4, t);
    default: return blend_at(field, met, count > 1 ? count : 1, t);
    }
}

// Returns 1/a to an ulp or two.
static inline vfloat rcp_newton(vfloat a) {
    vfloat per = v_rcp_approx(a);
    return per * v_nmadd(a, per, v_splat(2.0f));
}

// Returns the root of a > 0, or up to 2⁻⁹ more.
static inline vfloat root_above(vfloat a) {
    vfloat some = v_max(a, v_splat(1e-30f));
    return some * v_rsqrt_approx(some) * v_splat(1.0f + 0x1p-10f);
}

// Returns how far excess + slope·x − bend·x²/2 stays above 0, or a little less.
static inline vfloat bent_root(vfloat excess, vfloat slope, vfloat bend) {
    vfloat zero = v_splat(0.0f), tiny = v_splat(1e-12f);
    bend = v_madd(bend, v_splat(1 + 0x1p-10f), v_splat(1e-4f));
    vfloat root = v_sqrt_below(v_max(v_madd(slope, slope, (bend + bend) * excess), tiny));
    vmask down = v_cmp_lt(slope, zero);
    vfloat over = v_select(down, excess + excess, slope + root);
    vfloat under = v_select(down, v_max(root - slope, tiny), bend);
    return over * v_rcp_approx(under) * v_splat(1 - 0x1p-10f);
}
