// flags: -O1 -DLANES=8 -mavx2 -mfma -ffp-contract=off -iquote tests/c/spans -iquote phases/opt12_fused -iquote phases/opt11_ideal -iquote phases/opt10_scene -iquote phases/opt9_convex -iquote phases/opt6_wide -Wno-unused-function
// What a kernel of opt12_fused leaves out, against what its own code finds in float (PROOFS.md, 6. to 9.): where a shadow,
// a mirrored solid or a hit just begins, found by bisection; near the origin, and in small scenes far from it.
#include "kernel/kernel_scene.h"

enum { WHOLE_SHININESS = 0, ONE_MATERIAL = 0 };
static struct known_scene scene_known;

#include "span_scenes.h"

#include "frame/lighting.h"
#include "hit/solids.h"
#include "hit/torus.c"
#include "shadow/own_solid.h"
#include "shadow/shadow_cone.h"
#include "shadow/soft_packet.h"
#include "shadow/widest_torus.h"
#include "types/sdf.h"
#include "types/tile_context.h"

static vmask in_bounds_nearly(const vfloat parts[8], vmask doubtful,
                              const struct known_scene *known) { // no ray here goes so far
    (void)parts;
    (void)known;
    return doubtful;
}

#include "fused/fused.h"

#include "fused/light.h"

#include "fused/torus.h"

#include "fused/follow.h"

#include "fused/smooth.h"

enum { CLOSE = MANY(240), STEPS = 45, SIDE = 4 * LANES };

static struct random_scene scene;
static struct fused fused;

// Every other scene is small, and its points have few bits.
static void set_near_or_far(int n) {
    unit = n % 2 ? 0.02 : 1;
    for (int k = 0; k < 3; k++)
        away[k] = n % 2 ? random_from(20, 52) : 0;
    set_scene(&scene, SIDE, SIDE);
    scene.view.tan_half_fov = pow(10, random_from(-6, -3));
}

// As fused_begin() does.
static void set_fused(void) {
    scene_known = scene.known;
    assert_true(
        fused_frame_set(&scene.known, &scene.view, scene.width, scene.height, LANES, &fused.frame));
    fused.per = (float)fused.frame.per_pixel;
    for (int k = 0; k < 3; k++) {
        fused.eye[k] = (float)scene.view.position[k];
        fused.forward[k] = (float)scene.view.forward[k];
        fused.right[k] = (float)scene.view.right[k];
        fused.up[k] = (float)scene.view.up[k];
        fused.light[k] = (float)scene.view.light_position[k];
    }
    for (int i = 0; i < PLANES; i++) {
        fused.height[i] = (float)height_of(&scene.shape[i], scene.view.position);
        fused.light_height[i] = (float)height_of(&scene.shape[i], scene.view.light_position);
    }
}

// Packets at (x, y) and (x, y + 1) on plane i.
struct on_plane {
    struct vec d[ROWS], p[ROWS];
};

static struct on_plane look_at_plane(int i, int x, int y, bool edges) {
    struct on_plane at;
    EACH_ROW(k) {
        float up = (float)(scene.height - 1 - 2 * (y + k)) * fused.per;
        struct row r = {.d = vec_along(vec_set(fused.forward), vec_set(fused.up), v_splat(up)),
                        .up = up};
        at.d[k] = edges ? look_at_edges(&fused, &r, x) : look(&fused, &r, x);
        at.p[k] = vec_along(vec_set(fused.eye), to_plane(i, at.d[k], &fused), v_splat(1));
    }
    return at;
}

// Which rays from p to the light solid j darkens.
static void darkened_by(int j, const struct vec p[ROWS], vmask dark[ROWS]) {
    struct light_rays rays[ROWS];
    vfloat best[ROWS];
    EACH_ROW(k) {
        struct vec l = vec_sub(vec_set(fused.light), p[k]);
        vfloat square = vec_dot(l, l), per = v_rsqrt_newton(square);
        set_light_rays(&rays[k], p[k], l, per, square * per, v_mask_all());
        best[k] = lit_best();
    }
    darken_by_others(bit_of(j), rays, best);
    EACH_ROW(k) dark[k] = v_cmp_lt(best[k], lit_best());
}

// Which mirror rays of plane i meet solid j.
static void mirrored_on(int i, int j, const struct on_plane *at, vmask met[ROWS]) {
    struct mirror_rays rays[ROWS];
    struct ends end[ROWS];
    EACH_ROW(k) {
        struct seen seen;
        set_seen(&seen, v_mask_all(), at->p[k], at->p[k], at->d[k], at->d[k], v_splat(1));
        no_mirror_rays(&rays[k]);
        reflect(i, &seen, v_splat(1), &rays[k]);
        no_hit(&end[k].hit);
    }
#define MEET(s)                                                                                    \
    if (j == (s))                                                                                  \
        mirror_to_solid_##s(rays, &fused, end);
    EACH_SOLID(MEET)
#undef MEET
    EACH_ROW(k) met[k] = end[k].hit.found;
}

// Which pixels of plane i are darkened by solid j, or show it mirrored.
static void seen_on_plane(int i, int j, bool mirrored, int x, int y, bool edges, vmask seen[ROWS]) {
    struct on_plane at = look_at_plane(i, x, y, edges);
    if (mirrored)
        mirrored_on(i, j, &at, seen);
    else
        darkened_by(j, at.p, seen);
}

// Sets p to the point of plane i where j's centre darkens it, or is seen in it. Returns false if there is none.
static bool middle_on_plane(int i, int j, bool mirrored, double p[3]) {
    const struct primitive *plane = &scene.shape[i];
    double from[3], d[3];
    span_along(mirrored ? scene.view.position : scene.view.light_position, plane->row[0], 0, from);
    if (mirrored)
        span_along(from, plane->row[0], -2 * height_of(plane, from), from);
    span_along(scene.shape[j].centre, from, -1, d);
    double t = -height_of(plane, from) / dot3(d, plane->row[0]);
    span_along(from, d, t, p);
    return (mirrored ? t > 0 && t < 1 : t > 1) && dot3(p, p) < 0.9 * BOUNDS * BOUNDS;
}

// Turns the telescope to where solid j begins to be seen on plane i, between two points of it.
static void aim_between(int i, int j, bool mirrored, double in[3], double out[3]) {
    for (int step = 0; step < STEPS; step++) {
        double at[3];
        vmask seen[ROWS];
        for (int k = 0; k < 3; k++)
            at[k] = 0.5 * (in[k] + out[k]);
        aim(&scene, at);
        set_fused();
        seen_on_plane(i, j, mirrored, SIDE / 2, SIDE / 2, true, seen);
        memcpy(v_mask_bits(seen[0]) & 1 ? in : out, at, sizeof at);
    }
}

// The same, from a point where it is seen.
static void aim_at_begin(int i, int j, bool mirrored, double in[3]) {
    double out[3], side[3];
    direction_from(side);
    if (!mirrored) { // where a shadow is farthest from the light, its region is tight
        span_along(in, scene.view.light_position, -1, out);
        span_along(out, side, 0.05 * sqrt(dot3(out, out)), side);
        normalize3(side);
    }
    span_along(in, side, 60 * unit, out);
    span_along(out, scene.shape[i].row[0], -height_of(&scene.shape[i], out), out);
    aim_between(i, j, mirrored, in, out);
}

// What the telescope sees of solid j on plane i, against what the spans and circles say. Returns how many packets do.
static int hold_telescope(int i, int j, bool mirrored) {
    static struct fused_span spans[SPAN_MOST];
    static struct fused_band band;
    int count = 0;
    for (int y = 0; y < SIDE; y += ROWS) {
        fused_band_set(&fused.frame, y, ROWS, &band);
        fused_spans_of_rows(&fused.frame, &band, y, ROWS, spans);
        for (int x = 0; x < SIDE; x += LANES)
            for (int edges = 0; edges < 2; edges++) {
                vmask seen[ROWS];
                seen_on_plane(i, j, mirrored, x, y, edges, seen);
                const struct fused_span *span = span_at(spans, x);
                if (!any_of(seen) || !(span->hits >> i & 1))
                    continue;
                assert_true((mirrored ? span->reflected : span->darkeners) >> j & 1);
                struct on_plane at = look_at_plane(i, x, y, edges);
                if (!mirrored)
                    assert_true(darkeners_at(i, at.p, seen, &fused.frame) >> j & 1);
                count++;
            }
    }
    return count;
}

// Sets the light high above solid j, and of so narrow a cone that regions are tight.
static void raise_light(int i, int j) {
    double side[3], *light = scene.view.light_position;
    direction_from(side);
    span_along(scene.shape[j].centre, scene.shape[i].row[0], unit * random_from(20, 60), light);
    span_along(light, side, unit * random_from(0, 9), light);
    scene.known.model.shadow_strength = random_from(50, 100) / unit;
}

static void hold_begins(bool mirrored) {
    int count = 0;
    for (int n = 0; n < CLOSE; n++) {
        double in[3];
        set_near_or_far(n);
        int i = n / 2 % PLANES, j = PLANES + n / 2 / PLANES % SOLIDS;
        if (!mirrored)
            raise_light(i, j);
        if (!middle_on_plane(i, j, mirrored, in))
            continue;
        aim_at_begin(i, j, mirrored, in);
        count += hold_telescope(i, j, mirrored) > 0;
    }
    assert_true(count > CLOSE / 20);
}

TEST(test_where_shadows_begin) {
    hold_begins(false);
}

// Sets so low a light that the shadow of solid j on plane i ends far off, in a circle of 1e5: float hardly knows its rim.
static void lower_light(int i, int j) {
    const struct primitive *plane = &scene.shape[i], *s = &scene.shape[j];
    double side[3], at[3], low = 0, high = 60 * unit;
    direction_from(side);
    span_along(side, plane->row[0], -dot3(side, plane->row[0]), side);
    span_along(s->centre, side, unit * random_from(4, 9) / sqrt(dot3(side, side)), at);
    scene.known.model.shadow_strength = random_from(5e4, 1e5) / unit;
    for (int step = 0; step < STEPS; step++) {
        span_along(at, plane->row[0], 0.5 * (low + high), scene.view.light_position);
        set_fused();
        bool wide = true;
        for (int k = 0; k < fused.frame.dark_count; k++)
            if (fused.frame.dark[k].plane == i && fused.frame.dark[k].solid == j)
                wide = fused.frame.dark[k].radius_sq > 1e10f;
        *(wide ? &low : &high) = 0.5 * (low + high);
    }
    span_along(at, plane->row[0], high, scene.view.light_position);
}

TEST(test_where_wide_shadows_begin) {
    int count = 0;
    for (int n = 0; n < CLOSE; n++) {
        double in[3], out[3];
        set_near_or_far(n);
        int i = n / 2 % PLANES, j = PLANES + n / 2 / PLANES % SOLIDS;
        lower_light(i, j);
        if (!middle_on_plane(i, j, false, in))
            continue;
        const double *light = scene.view.light_position, *up = scene.shape[i].row[0];
        span_along(light, up, -height_of(&scene.shape[i], light), out);
        aim_between(i, j, false, in, out);
        count += hold_telescope(i, j, false) > 0;
    }
    assert_true(count > CLOSE / 20);
}

TEST(test_where_mirrored_solids_begin) {
    hold_begins(true);
}

// The darkest point of sphere I begins to be darkened by sphere J.
TEST(test_where_pairs_begin) {
    enum { I = PLANES, J = PLANES + 4 };
    int count = 0;
    for (int n = 0; n < CLOSE; n++) {
        double m[3], z[3], p[3], in, out;
        set_near_or_far(n);
        struct primitive *s = &scene.shape[I];
        s->type = SHAPE_SPHERE;
        set_size(s, unit);
        raise_light(0, J);
        between(&scene, J, 1 / scene.known.model.shadow_strength, m);
        farthest_point(&scene, J, m, z);
        span_along(z, scene.view.light_position, -1, p);
        span_along(z, p, random_from(0, 1), z); // lit along the cone of both
        in = 0.9 * s->a;
        out = 1.1 * s->a;
        for (int step = 0; step < STEPS; step++) {
            struct vec at[ROWS];
            vmask dark[ROWS];
            span_along(z, m, 0.5 * (in + out), s->centre);
            for (int k = 0; k < 3; k++)
                p[k] = (float)s->centre[k] - s->a * m[k];
            EACH_ROW(k) at[k] = vec_from_doubles(p);
            set_fused();
            darkened_by(J, at, dark);
            *(v_any(dark[0]) ? &in : &out) = 0.5 * (in + out);
        }
        span_along(z, m, in, s->centre);
        set_fused();
        if (in == 0.9 * s->a)
            continue;
        assert_true(fused.frame.pair[I] >> J & 1);
        count++;
    }
    assert_true(count > CLOSE / 4);
}

// Mirror rays, a lane each; the second row has none.
struct lanes {
    float origin[3][LANES], direction[3][LANES];
};

static void set_lane(struct lanes *to, int lane, const double o[3], const double d[3]) {
    for (int k = 0; k < 3; k++) {
        to->origin[k][lane] = (float)o[k];
        to->direction[k][lane] = (float)(d[k] / sqrt(dot3(d, d)));
    }
}

static void rays_of(const struct lanes *from, int leaves, struct mirror_rays rays[ROWS]) {
    EACH_ROW(k) {
        no_mirror_rays(&rays[k]);
        rays[k].origin =
            (struct vec){v_load(from->origin[0]), v_load(from->origin[1]), v_load(from->origin[2])};
        rays[k].direction = (struct vec){v_load(from->direction[0]), v_load(from->direction[1]),
                                         v_load(from->direction[2])};
        rays[k].leaves = v_splat((float)leaves);
        rays[k].active = k ? v_mask_none() : v_mask_all();
    }
}

// Rays that hardly go over the top of what a guard holds.
TEST(test_guards_in_float) {
    int met = 0, cleared = 0;
    for (int n = 0; n < CLOSE; n++) {
        set_near_or_far(n);
        set_fused();
        int i = PLANES + 1 + 2 * (n / 2 % 3), g = n / 6 % SPAN_GUARDS, j = i;
        if (!isfinite(fused.frame.guard_top[i][g]))
            continue;
        double m[3], top[3] = {0, 0, 0}, side[3], o[3], d[3], most = -INFINITY;
        for (int k = 0; k < 3; k++)
            m[k] = fused.frame.guard[i][g][k];
        for (int s = PLANES; s < SHAPES; s++) {
            farthest_point(&scene, s, m, o);
            if ((s != i || !scene.shape[s].convex) && dot3(o, m) > most) {
                most = dot3(o, m);
                memcpy(top, o, sizeof top);
                j = s;
            }
        }
        struct lanes lanes;
        for (int lane = 0; lane < LANES; lane++) {
            direction_from(side);
            span_along(side, m, -dot3(side, m), side);
            span_along(side, m, random_from(-1, 1) * 1e-7, d);
            span_along(top, side, -unit * pow(10, random_from(-1, 1)), o);
            span_along(o, m, (lane % 2 ? 1 : -1) * BOUNDS * pow(10, random_from(-9, -3)), o);
            set_lane(&lanes, lane, o, d);
        }
        struct mirror_rays rays[ROWS];
        struct ends end[ROWS];
        rays_of(&lanes, i, rays);
        EACH_ROW(k) no_hit(&end[k].hit);
#define MEET(s)                                                                                    \
    if (j == (s))                                                                                  \
        mirror_to_solid_##s(rays, &fused, end);
        EACH_SOLID(MEET)
#undef MEET
        for (int lane = 0; lane < LANES; lane++) {
            rays[0].active = is_shape(v_iota(), lane);
            bool hit = v_any(v_and(rays[0].active, end[0].hit.found));
            bool may = may_meet(rays, &fused.frame, i);
            assert_true(may || !hit);
            met += hit;
            cleared += !may;
        }
    }
    assert_true(met > CLOSE / 4 && cleared > CLOSE / 4);
}

// Rays that begin to meet a sphere, which is its own bound.
TEST(test_where_spheres_begin) {
    enum { S = PLANES + 4 };
    int met = 0;
    for (int n = 0; n < CLOSE; n++) {
        double o[3], side[3], to[3], d[3], in = 0, out = 2;
        struct mirror_rays rays[ROWS];
        struct lanes lanes;
        struct vec from[ROWS], along[ROWS];
        struct torus_hit hit[ROWS];
        vmask active[ROWS], behind[ROWS];
        set_near_or_far(n);
        set_fused();
        const struct primitive *s = &scene.shape[S];
        assert_true(s->type == SHAPE_SPHERE);
        direction_from(side);
        span_along(s->centre, side, (n % 4 < 2 ? 1 : -1) * unit * random_from(3, 40), o);
        direction_from(side);
        span_along(s->centre, o, -1, to);
        span_along(side, to, -dot3(side, to) / dot3(to, to), side);
        normalize3(side);
        for (int step = 0; step < STEPS; step++) {
            for (int lane = 0; lane < LANES; lane++) {
                span_along(to, side, s->a * (0.5 * (in + out) + lane * 1e-7), d);
                set_lane(&lanes, lane, o, d);
            }
            rays_of(&lanes, 0, rays);
            EACH_ROW(k) {
                from[k] = to_local(s, rays[k].origin);
                along[k] = turned(s, rays[k].direction);
                active[k] = rays[k].active;
                behind[k] = v_mask_none();
            }
            enter_from_mirror_6(from, along, active, hit, behind);
            assert_false(v_any(v_andnot(may_come_near(s, &rays[0]), hit[0].met)));
            met += v_any(hit[0].met);
            *(v_mask_bits(hit[0].met) & 1 ? &in : &out) = 0.5 * (in + out);
        }
    }
    assert_true(met > CLOSE);
}

RUN_TESTS(NULL, NULL)
