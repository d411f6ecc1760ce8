// flags: -O2 -iquote phases/opt12_fused -iquote phases/opt11_ideal -iquote phases/opt10_scene -iquote phases/opt9_convex -iquote phases/opt6_wide
// What solids darken, what mirrors show, and the polynomials of a row (opt12_fused, PROOFS.md, 6. to 10.), in double.
#include "span_scenes.h"

enum { SCENES = MANY(30), POINTS = 300, ROWS = MANY(1200), GRAIN = 8, COLUMNS = 201, LINES = 101 };

static struct fused_frame frame;

static void set_frame(struct random_scene *scene) {
    assert_true(
        fused_frame_set(&scene->known, &scene->view, scene->width, scene->height, GRAIN, &frame));
}

// The span of the picture's middle pixel, at whose centre p is.
static const struct fused_span *span_of_point(struct random_scene *scene, const double p[3]) {
    static struct fused_span spans[SPAN_MOST];
    static struct fused_band band;
    aim(scene, p);
    set_frame(scene);
    fused_band_set(&frame, LINES / 2, 2, &band);
    fused_spans_of_rows(&frame, &band, LINES / 2, 2, spans);
    return span_at(spans, COLUMNS / 2);
}

// Whether z comes into the cone of slope q about the ray from p to the light: |p + t·l − z| < q·t for a t up to there.
static bool darkens(const struct random_scene *scene, const double p[3], const double z[3],
                    double q) {
    double to[3], apart[3], at[3];
    span_along(scene->view.light_position, p, -1, to);
    span_along(z, p, -1, apart);
    double far = sqrt(dot3(to, to)), t = dot3(apart, to) / far;
    double across = sqrt(fmax(dot3(apart, apart) - t * t, 0));
    t = fmin(t + across * q / sqrt(1 - q * q), far); // where the cone is nearest to z
    span_along(apart, to, -t / far, at);
    return t > 0 && sqrt(dot3(at, at)) < q * t;
}

static bool is_nearest_plane(const struct random_scene *scene, int i, const double p[3]) {
    for (int j = 0; j < PLANES; j++)
        if (j != i && height_of(&scene->shape[j], p) < 1e-3)
            return false;
    return dot3(p, p) < 0.999 * BOUNDS * BOUNDS;
}

// A point of plane i that a point z of a solid darkens: the cone about its ray to the light, of slope q, holds z. v: a
// direction; the ray that leads through z leans that way. Returns false if there is none.
static bool darkened_point(const struct random_scene *scene, int i, const double z[3],
                           const double v[3], double q, double p[3]) {
    const struct primitive *plane = &scene->shape[i];
    const double *light = scene->view.light_position;
    double far = 2 * BOUNDS, to[3], on = height_of(plane, z);
    for (int step = 0; step < 60; step++) {
        double from[3], d[3];
        span_along(light, v, 0.999999 * q * far, from);
        span_along(z, from, -1, d);
        double fall = dot3(plane->row[0], d);
        if (!(fall < 0))
            return false;
        span_along(z, d, -on / fall, p);
        span_along(light, p, -1, to);
        far = sqrt(dot3(to, to));
        if (!(far < 1e4))
            return false;
    }
    return darkens(scene, p, z, q);
}

// Holds p, a point of plane i that solid j darkens, against regions and spans. Returns its region.
static int hold_darkened(struct random_scene *scene, int i, int j, const double p[3], double *far) {
    int region = 0;
    while (frame.dark[region].plane != i || frame.dark[region].solid != j)
        assert_true(++region < frame.dark_count);
    double to[3];
    for (int a = 0; a < 3; a++)
        to[a] = p[a] - frame.dark[region].centre[a];
    *far = dot3(to, to) / frame.dark[region].radius_sq;
    assert_true(*far <= 1);
    const struct fused_span *span = span_of_point(scene, p);
    assert_true(span->kind == SPAN_SOLID || (span->hits >> i & 1));
    assert_true(span->kind == SPAN_SOLID || (span->darkeners >> j & 1));
    return region;
}

TEST(test_darkened_points) {
    int seen = 0, tight = 0;
    for (int n = 0; n < SCENES; n++) {
        struct random_scene scene;
        set_scene(&scene, COLUMNS, LINES);
        set_frame(&scene);
        double most[SPAN_DARK] = {0};
        for (int k = 0; k < POINTS; k++) {
            int i = k % PLANES, j = PLANES + k / PLANES % SOLIDS;
            double z[3], v[3], p[3];
            between(&scene, j, frame.slope, v);
            farthest_point(&scene, j, v, z);
            for (int a = 0; a < 3; a++)
                v[a] = -v[a];
            if (!darkened_point(&scene, i, z, v, frame.slope, p) || !is_nearest_plane(&scene, i, p))
                continue;
            double far;
            int region = hold_darkened(&scene, i, j, p, &far);
            most[region] = fmax(most[region], far);
            seen++;
        }
        for (int r = 0; r < frame.dark_count; r++)
            tight += most[r] > 0.8;
    }
    assert_true(seen > SCENES * POINTS / 50 && tight > SCENES / 10);
}

// A large sphere that is sunk in a plane, and a low light far from it: the apex of the cone between them is below the plane.
TEST(test_sunken_solids) {
    enum { S = SHAPES - 2 };
    int seen = 0;
    for (int n = 0; n < SCENES; n++) {
        struct random_scene scene;
        double side[3], p[3], z[3], far, *light = scene.view.light_position;
        set_scene(&scene, COLUMNS, LINES);
        struct primitive *s = &scene.shape[S];
        const double *up = scene.shape[0].row[0];
        assert_true(s->type == SHAPE_SPHERE);
        set_size(s, 10);
        direction_from(side);
        span_along(side, up, -dot3(side, up), side);
        normalize3(side);
        span_along(s->centre, up, -height_of(&scene.shape[0], s->centre) - 0.4 * s->a, s->centre);
        span_along(s->centre, side, random_from(40, 50), light);
        span_along(light, up, 1 - height_of(&scene.shape[0], light), light);
        scene.known.model.shadow_strength = 5;
        if (!is_clear(&scene, light) || !is_clear(&scene, scene.view.position))
            continue;
        set_frame(&scene);
        for (int k = 0; k < POINTS; k++) {
            direction_from(z);
            span_along(s->centre, z, s->a * random_from(0, 1), z);
            direction_from(p);
            span_along(s->centre, p, random_from(0, 60), p);
            span_along(p, up, -height_of(&scene.shape[0], p), p);
            if (!darkens(&scene, p, z, frame.slope) || !is_nearest_plane(&scene, 0, p))
                continue;
            hold_darkened(&scene, 0, S, p, &far);
            seen++;
        }
    }
    assert_true(seen > SCENES);
}

// Solids on which another may cast its shadow.
TEST(test_pairs) {
    int clear = 0, found = 0;
    for (int n = 0; n < SCENES; n++) {
        struct random_scene scene;
        set_scene(&scene, COLUMNS, LINES);
        set_frame(&scene);
        for (int k = 0; k < POINTS; k++) {
            int i = PLANES + k % SOLIDS, j = PLANES + (k / SOLIDS + 1 + k) % SOLIDS;
            double p[3], z[3], m[3];
            if (i == j)
                continue;
            clear += !(frame.pair[i] >> j & 1);
            between(&scene, j, frame.slope, m);
            farthest_point(&scene, j, m, z);
            for (int a = 0; a < 3; a++)
                m[a] = -m[a];
            farthest_point(&scene, i, m, p);
            if (!darkens(&scene, p, z, frame.slope))
                continue;
            assert_true(frame.pair[i] >> j & 1);
            found++;
        }
    }
    assert_true(found > SCENES * POINTS / 50 && clear > SCENES * POINTS / 50);
}

TEST(test_mirrored_solids) {
    int seen = 0, cleared = 0;
    for (int n = 0; n < SCENES; n++) {
        struct random_scene scene;
        set_scene(&scene, COLUMNS, LINES);
        set_frame(&scene);
        for (int k = 0; k < POINTS; k++) {
            int i = k % PLANES, j = PLANES + k / PLANES % SOLIDS;
            const struct primitive *plane = &scene.shape[i];
            double z[3], image[3], d[3], p[3];
            point_of(&scene, j, z);
            double height = height_of(plane, scene.view.position), offset = 1e-3;
            span_along(scene.view.position, plane->row[0], offset - 2 * height, image);
            span_along(z, image, -1, d);
            double above = height_of(plane, z) - offset;
            if (!(above > 0))
                continue;
            span_along(z, d, -above / dot3(d, plane->row[0]), p);
            span_along(p, plane->row[0], -offset, p); // the mirror ray starts above it
            if (!is_nearest_plane(&scene, i, p))
                continue;
            const struct fused_span *span = span_of_point(&scene, p);
            assert_true(span->kind == SPAN_SOLID || (span->reflected >> j & 1));
            seen++;
            cleared += SOLIDS - __builtin_popcountll(span->reflected);
        }
    }
    assert_true(seen > SCENES * POINTS / 50 && cleared > seen * SOLIDS / 4);
}

enum { LIGHT, AMBIENT, FACING, PARTS };

// What a plane's colour is made of at x of a row, by its definition.
static void parts_at(const struct random_scene *scene, int i, double x, double y,
                     double part[PARTS]) {
    const struct view *view = &scene->view;
    const struct primitive *plane = &scene->shape[i];
    double d[3], p[3], l[3], m[3];
    for (int k = 0; k < 3; k++)
        d[k] = view->forward[k] + x * view->right[k] + y * view->up[k];
    normalize3(d);
    double down = dot3(plane->row[0], d);
    span_along(view->position, d, -height_of(plane, view->position) / down, p);
    span_along(view->light_position, p, -1, l);
    span_along(d, plane->row[0], -2 * down, m);
    double far = sqrt(dot3(l, l)), square = dot3(p, p), shine = fmax(dot3(m, l) / far, 0);
    double fogged = exp(-scene->known.model.fog * square * sqrt(square));
    part[FACING] = dot3(plane->row[0], l) / far;
    part[AMBIENT] = 0.01 * plane->color[0] * fogged;
    part[LIGHT] = view->light_emission[0] * fogged / far *
                  (plane->color[0] * part[FACING] + 0.2 * pow(shine, plane->shininess));
}

static double color_of(const struct random_scene *scene, const double part[PARTS]) {
    double share = fmin(1, scene->known.model.shadow_strength * part[FACING]);
    return part[LIGHT] * share + part[AMBIENT];
}

// Neville's scheme: the polynomial through six nodes, at u.
static double through_nodes(const double nodes[6], double u) {
    double p[6];
    memcpy(p, nodes, sizeof p);
    for (int n = 1; n < 6; n++)
        for (int k = 0; k + n < 6; k++)
            p[k] = ((u - k - n) * p[k] + (k - u) * p[k + 1]) / -n;
    return p[0];
}

#define MOST 1e-6

// The colours of a row between the nodes that its spacing allows, against those of their polynomials. Returns the spacing.
static int hold_row(const struct random_scene *scene, int i, int y, int x0, int x1) {
    double per = scene->view.tan_half_fov / 720, up = (719 - 2 * y) * per;
    int spacing = fused_spacing(&frame, i, y, 1, x0, x1, MOST);
    assert_true(spacing == 64 || spacing == 32 || spacing == 16 || spacing == 0);
    for (int left = spacing ? x0 - x0 % spacing : x1; left < x1; left += spacing) {
        double nodes[PARTS][6], part[PARTS];
        for (int k = 0; k < 6; k++) {
            parts_at(scene, i, (2 * (left + (k - 2) * spacing) + 1 - 1280) * per, up, part);
            for (int c = 0; c < PARTS; c++)
                nodes[c][k] = part[c];
        }
        for (int x = left; x < left + spacing; x += 3) {
            parts_at(scene, i, (2 * x + 1 - 1280) * per, up, part);
            double exact = color_of(scene, part);
            for (int c = 0; c < PARTS; c++)
                part[c] = through_nodes(nodes[c], 2 + (double)(x - left) / spacing);
            double error = fabs(color_of(scene, part) - exact);
            assert_true(error <= MOST);
        }
    }
    return spacing;
}

// A row of a picture, and the middle of what it shows of a plane: p, seen along d.
struct plane_row {
    int plane, y, x0, x1;
    double d[3], p[3];
};

// Sets a random scene and a row of it. Returns false if the row's middle does not see the plane.
static bool set_row(struct random_scene *scene, int n, struct plane_row *row) {
    set_scene(scene, 1280, 720);
    row->plane = n % PLANES;
    row->y = (int)random_from(0, 719);
    row->x0 = 16 * (int)random_from(0, 70);
    row->x1 = row->x0 + 16 * (int)random_from(1, 20);
    const struct primitive *plane = &scene->shape[row->plane];
    double ahead[3]; // a level camera: a rolled one has few rows of polynomials
    span_along(scene->view.position, scene->view.forward, 1, ahead);
    if (n % 8 && view_aim(&scene->view, ahead, plane->row[0]) != AIM_OK)
        return false;
    double per = scene->view.tan_half_fov / 720, up = (719 - 2 * row->y) * per;
    double middle = ((row->x0 + row->x1) - 1280) * per;
    for (int k = 0; k < 3; k++)
        row->d[k] = scene->view.forward[k] + middle * scene->view.right[k] + up * scene->view.up[k];
    double down = dot3(row->d, plane->row[0]);
    span_along(scene->view.position, row->d, -height_of(plane, scene->view.position) / down,
               row->p);
    return down < 0;
}

TEST(test_polynomials) {
    static const double shine[4] = {15, 8, 2.5, 60};
    int some = 0, rows = 0;
    for (int n = 0; n < ROWS; n++) {
        struct random_scene scene;
        struct plane_row row;
        if (!set_row(&scene, n, &row))
            continue;
        struct primitive *plane = &scene.shape[row.plane];
        double *lamp = scene.view.light_position;
        plane->shininess = (float)shine[n / PLANES % 4];
        for (int k = 0; k < 3 && n % 3 == 0; k++) // just above what the row shows
            lamp[k] = row.p[k] + random_from(-2, 2) + random_from(1, 4) * plane->row[0][k];
        scene.known.model.fog = n % 3 == 0 ? 0 : pow(10, random_from(-6, -3));
        if (n % 5 == 0) // brighter than its light
            for (int k = 0; k < 3; k++) {
                scene.view.light_emission[k] = 0;
                plane->color[k] = 1000;
            }
        if (height_of(plane, lamp) < 0.3)
            continue;
        set_frame(&scene);
        some += hold_row(&scene, row.plane, row.y, row.x0, row.x1) != 0;
        rows++;
    }
    assert_true(some > rows / 5);
}

// A highlight of low or broken power, which ends in the row: its cosine is 0 there.
TEST(test_highlights_that_end) {
    static const double shine[4] = {1.5, 2, 2.5, 3};
    int rows = 0;
    for (int n = 0; n < ROWS; n++) {
        struct random_scene scene;
        struct plane_row row;
        double mirrored[3], to[3];
        if (!set_row(&scene, n, &row))
            continue;
        struct primitive *plane = &scene.shape[row.plane];
        plane->shininess = (float)shine[n / PLANES % 4];
        span_along(row.d, plane->row[0], -2 * dot3(row.d, plane->row[0]), mirrored);
        direction_from(to);
        span_along(to, mirrored, -dot3(to, mirrored) / dot3(mirrored, mirrored), to);
        span_along(row.p, to, random_from(10, 40), scene.view.light_position);
        scene.known.model.fog = 0;
        if (height_of(plane, scene.view.light_position) < 3)
            continue;
        set_frame(&scene);
        hold_row(&scene, row.plane, row.y, row.x0, row.x1);
        rows++;
    }
    assert_true(rows > ROWS / 20);
}

RUN_TESTS(NULL, NULL)
