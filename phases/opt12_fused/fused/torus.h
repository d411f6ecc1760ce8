// Rays to a torus: the marches of all rows in turns.
#pragma once

// Where a packet enters a torus ahead of its rays' origins.
struct torus_hit {
    vmask met;
    vfloat t;
    struct vec local;
};

// o, d: the rays in the torus's frame.
INLINE void enter_tori(const struct primitive *s, const struct vec o[ROWS],
                       const struct vec d[ROWS], const vmask active[ROWS],
                       struct torus_hit hit[ROWS]) {
    struct torus_march w[ROWS];
    struct vec c[ROWS];
    vfloat before[ROWS], zero = v_splat(0.0f);
    vmask going[ROWS];
    EACH_ROW(k) {
        before[k] = zero - vec_dot(o[k], d[k]);
        c[k] = vec_along(o[k], d[k], before[k]);
        vfloat rest = v_splat(s->bound_sq) - vec_dot(c[k], c[k]);
        vfloat half = v_sqrt(v_max(rest, zero));
        vmask near = v_cmp_gt_in(v_cmp_gt_in(active[k], rest, zero), before[k] + half, zero);
        begin_torus(c[k], d[k], s, near, v_max(zero - half, zero - before[k]), &w[k]);
        going[k] = w[k].going;
    }
    for (int step = 0; step < MOST_TORUS_STEPS && any_of(going); step++)
        EACH_ROW(k) {
            step_torus(c[k], d[k], s, &w[k]);
            going[k] = w[k].going;
        }
    EACH_ROW(k) {
        hit[k].t = before[k] + w[k].at;
        hit[k].met = v_cmp_gt_in(w[k].found, hit[k].t, zero);
        hit[k].local = vec_along(c[k], d[k], w[k].at);
    }
}

#define ENTER(i)                                                                                   \
    NOINLINE void enter_tori_##i(const struct vec o[ROWS], const struct vec d[ROWS],               \
                                 const vmask active[ROWS], struct torus_hit hit[ROWS]) {           \
        enter_tori(SHAPE(i), o, d, active, hit);                                                   \
    }
EACH_SOLID(ENTER)
#undef ENTER
