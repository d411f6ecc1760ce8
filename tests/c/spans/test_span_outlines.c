// flags: -O2 -DLANES=8 -mavx2 -mfma -ffp-contract=off -iquote phases/opt12_fused -iquote phases/opt11_ideal -iquote phases/opt10_scene -iquote phases/opt9_convex -iquote phases/opt6_wide
// Outlines of solids and planes (opt12_fused, PROOFS.md, 1. to 5.) against rays in float.
#include "span_scenes.h"

#include "hit/solids.h"
#include "hit/torus.c"

enum { SCENES = MANY(60), CLOSE = MANY(600) };

static struct fused_frame frame;

vmask sharp_enter(const struct sharp *sharp, struct vec o, struct vec d, vmask active, vfloat from,
                  vfloat to, vfloat *t) { // what enter() links to
    (void)sharp, (void)o, (void)d, (void)to;
    *t = from;
    return active;
}

vmask field_enter(const struct field *field, struct vec o, struct vec d, vmask active, vfloat from,
                  vfloat to, vfloat *t) {
    (void)field, (void)o, (void)d, (void)to;
    *t = from;
    return active;
}

// The direction of LANES pixels from (x, y) on, as the phases compute it.
static struct vec rays_at(const struct random_scene *scene, int x, int y) {
    const struct view *view = &scene->view;
    float per = (float)(view->tan_half_fov / scene->height);
    vfloat column =
        v_madd(v_splat(2), v_iota(), v_splat((float)(2 * x + 1 - scene->width))) * v_splat(per);
    vfloat row = v_splat((float)(scene->height - 1 - 2 * y) * per);
    struct vec d =
        vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), column);
    d = vec_along(d, vec_from_doubles(view->up), row);
    return vec_scale(d, v_splat(1) / vec_norm(d));
}

// Which of the rays hit solid i, and how far off.
static unsigned met_by(const struct random_scene *scene, int i, struct vec d, float t[LANES]) {
    const struct primitive *s = &scene->shape[i];
    double from[3];
    float at[3];
    span_along(scene->view.position, s->centre, -1, from);
    for (int k = 0; k < 3; k++)
        at[k] = (float)dot3(s->row[k], from);
    struct vec point, local = {vec_dot(vec_set(s->turn[0]), d), vec_dot(vec_set(s->turn[1]), d),
                               vec_dot(vec_set(s->turn[2]), d)};
    vmask behind;
    vfloat far;
    vmask met = enter(vec_set(at), local, s, v_mask_all(), &far, &point, &behind);
    v_store(far, t);
    return v_mask_bits(met);
}

// Which of the rays come to plane i within the bounds, and how far off: as camera_hit() and in_bounds_nearly() say.
static unsigned seen_by(const struct random_scene *scene, int i, struct vec d, float t[LANES]) {
    const struct primitive *s = &scene->shape[i];
    double above = height_of(s, scene->view.position);
    float lane[3][LANES];
    unsigned seen = 0;
    v_store(v_splat((float)above) / (v_splat(0) - vec_dot(vec_set(s->normal), d)), t);
    v_store(d.x, lane[0]);
    v_store(d.y, lane[1]);
    v_store(d.z, lane[2]);
    for (int k = 0; k < LANES; k++) {
        double to[3] = {lane[0][k], lane[1][k], lane[2][k]}, p[3];
        span_along(scene->view.position, to, -above / dot3(s->row[0], to), p);
        seen |= (unsigned)(t[k] > 0 && dot3(p, p) <= BOUNDS * BOUNDS) << k;
    }
    return seen;
}

// The shapes that rays from (x, y) on meet first; −1: none. Beyond the bounds a plane still hides.
static void find_first(const struct random_scene *scene, int x, int y, int first[LANES]) {
    struct vec d = rays_at(scene, x, y);
    float least[LANES], t[LANES];
    unsigned seen[SHAPES];
    for (int k = 0; k < LANES; k++) {
        least[k] = INFINITY;
        first[k] = -1;
    }
    for (int i = 0; i < SHAPES; i++) {
        seen[i] = i < PLANES ? seen_by(scene, i, d, t) : met_by(scene, i, d, t);
        for (int k = 0; k < LANES; k++)
            if ((i < PLANES ? t[k] > 0 : seen[i] >> k & 1) && t[k] < least[k]) {
                least[k] = t[k];
                first[k] = i;
            }
    }
    for (int k = 0; k < LANES; k++)
        if (first[k] >= 0 && !(seen[first[k]] >> k & 1))
            first[k] = -1;
}

// What the rows show, by rays, against what the spans say.
static void hold_rows(const struct random_scene *scene, const struct fused_band *band, int y0,
                      int rows, int kinds[4]) {
    static struct fused_span spans[SPAN_MOST];
    int count = fused_spans_of_rows(&frame, band, y0, rows, spans);
    assert_true(count > 0 && spans[0].x0 == 0 && spans[count - 1].x1 == scene->width);
    for (int k = 1; k < count; k++)
        assert_true(spans[k].x0 == spans[k - 1].x1 && spans[k].x0 < spans[k].x1);
    for (int y = y0; y < y0 + rows; y++)
        for (int x = 0; x < scene->width; x += LANES) {
            const struct fused_span *span = span_at(spans, x);
            int first[LANES];
            find_first(scene, x, y, first);
            kinds[span->kind]++;
            for (int k = 0; k < LANES && x + k < scene->width; k++) {
                assert_true(first[k] < 0 || (span->hits >> first[k] & 1));
                if (span->kind == SPAN_PLANE || span->kind == SPAN_SOLID)
                    assert_int_equal(first[k], span->shape);
                if (span->kind == SPAN_BACKGROUND)
                    assert_int_equal(first[k], -1);
            }
        }
}

static void hold_picture(const struct random_scene *scene, int kinds[4]) {
    static struct fused_band band;
    assert_true(
        fused_frame_set(&scene->known, &scene->view, scene->width, scene->height, LANES, &frame));
    for (int top = 0; top < scene->height; top += SPAN_BAND) {
        int rows = scene->height - top < SPAN_BAND ? scene->height - top : SPAN_BAND;
        fused_band_set(&frame, top, rows, &band);
        for (int y = top; y < top + rows; y += 2)
            hold_rows(scene, &band, y, y + 1 < top + rows ? 2 : 1, kinds);
    }
}

TEST(test_pictures) {
    int kinds[4] = {0, 0, 0, 0}, all = 0;
    for (int i = 0; i < SCENES; i++) {
        struct random_scene scene;
        set_scene(&scene, 203, 75);
        hold_picture(&scene, kinds);
    }
    for (int k = 0; k < 4; k++)
        all += kinds[k];
    for (int k = 0; k < 4; k++)
        assert_true(kinds[k] > all / 500);
    assert_true(kinds[SPAN_MIXED] < all * 6 / 10);
}

// The eye next to a plate's corner or side.
TEST(test_near_solids) {
    int kinds[4] = {0, 0, 0, 0};
    for (int n = 0; n < 4 * SCENES; n++) {
        struct random_scene scene;
        double side[3], at[3];
        set_scene(&scene, 203, 75);
        struct primitive *s = &scene.shape[PLANES + n % SOLIDS];
        s->size[n / SOLIDS % 3] *= (float)pow(10, random_from(-2, 0));
        direction_from(side);
        span_along(s->centre, side, s->bound * (1.0003 + pow(10, random_from(-3, 0))),
                   scene.view.position);
        if (!is_clear(&scene, scene.view.position))
            continue;
        direction_from(side);
        span_along(s->centre, side, 1.5 * s->bound, at);
        aim(&scene, at);
        hold_picture(&scene, kinds);
    }
    assert_true(kinds[SPAN_SOLID] > 0);
}

// Looks through a telescope at a place where shape i begins: what float does there is many pixels wide.
TEST(test_where_shapes_begin) {
    int kinds[4] = {0, 0, 0, 0};
    for (int n = 0; n < CLOSE; n++) {
        struct random_scene scene;
        set_scene(&scene, 40, 40);
        int i = n % SHAPES;
        double in[3], out[3];
        memcpy(in, scene.shape[i].centre, sizeof in);
        direction_from(out);
        if (i < PLANES)
            span_along(in, scene.shape[i].row[0], scene.shape[i].offset, in);
        span_along(in, out, i < PLANES ? 4 * BOUNDS : 3 * scene.shape[i].bound, out);
        scene.view.tan_half_fov = pow(10, random_from(-6, -4));
        for (int step = 0; step < 60; step++) {
            double at[3];
            for (int k = 0; k < 3; k++)
                at[k] = 0.5 * (in[k] + out[k]);
            aim(&scene, at);
            int first[LANES];
            find_first(&scene, 20, 20, first);
            bool met = first[0] == i;
            memcpy(met ? in : out, at, sizeof at);
        }
        hold_picture(&scene, kinds);
    }
    assert_true(kinds[SPAN_MIXED] > 0);
}

RUN_TESTS(NULL, NULL)
