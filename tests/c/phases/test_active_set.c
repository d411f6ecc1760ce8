// flags: -iquote phases/opt9_convex -iquote phases/opt6_wide -DLANES=8 -mavx2 -mfma -ffp-contract=off
// opt9_convex's falling bounds (shadow/active_set.c): no shape may sleep where it is as near as the nearest shape so far.
// Distances to the bounding sphere are computed in double.
#include "tests/c/testing.h"

#include "random_from.h"
#include "shadow/active_set.c"

// A scene with groups has no active set.
vfloat field_distance(const struct field *field, struct vec p) {
    (void)field;
    return p.x;
}

// Rays that head for a sphere of bound 0.002, 0.0021 to 0.01 from its centre. Its distance falls as fast as t grows, and
// the bound's own slack (6e-4 of the way to the centre) is less than a float's ulp of t. Other rays pass the sphere, up
// to 0.02 beside, or have passed it: there the tangent bounds its distance, and far on the tangent's slope.
enum { PLACES = 40000, AFTER = 24 };
static const float bound = 0.002f;

struct meeting {
    double centre[3], along[3]; // centre as a float
    float t;
};

static struct meeting meeting_at(double least, double most, double beside) {
    struct meeting m;
    double square = 0;
    for (int k = 0; k < 3; k++) {
        m.along[k] = random_from(-1, 1);
        square += m.along[k] * m.along[k];
    }
    m.t = (float)random_from(least, most);
    double on = m.t + random_from(beside > 0 ? -0.01 : 0.0021, 0.01);
    for (int k = 0; k < 3; k++) {
        m.along[k] = (float)(m.along[k] / sqrt(square));
        m.centre[k] = (float)(m.along[k] * on + random_from(-beside, beside));
    }
    return m;
}

// Returns the distance to the sphere from the ray's point at t.
static double distance_from(const struct meeting *m, double t) {
    double square = 0;
    for (int k = 0; k < 3; k++)
        square += (m->centre[k] - t * m->along[k]) * (m->centre[k] - t * m->along[k]);
    return sqrt(square) - (double)bound;
}

static struct primitive sphere = {.eval = EVAL_POINT, .type = SHAPE_SPHERE, .bound = 0.002f};
static struct candidate shape = {.shape = &sphere, .bound = 0.002f};
static struct falling_bound below[4 * BATCH_PACKETS]; // shapes are tested four at a time

// The meetings as rays of a batch, one in each lane, and one shape: lane 0's own.
static void set_batch(struct shadow_batch *batch, const struct meeting *m) {
    *batch = (struct shadow_batch){.count = 1, .moving = 1};
    batch->set.count = batch->set.solids = 1;
    batch->set.shapes = &shape;
    batch->set.below = below;
    struct batch_packet *w = &batch->packet[0];
    *w = (struct batch_packet){.waits = v_mask_none(), .solid = -1};
    w->march.done = v_not(v_mask_first(1));
    w->rays.active = v_mask_first(1);
    w->march.t = v_splat(m->t);
    w->rays.to_light = (struct vec){v_splat((float)m->along[0]), v_splat((float)m->along[1]),
                                    v_splat((float)m->along[2])};
    for (int k = 0; k < 3; k++)
        shape.centre[k] = (float)m->centre[k];
    w->at = vec_along(w->start, w->rays.to_light, w->march.t);
}

// Returns a nearest distance for lane 0; the other lanes are idle.
static vfloat known(double distance) {
    return v_select(v_mask_first(1), v_splat((float)distance), v_splat(-INFINITY));
}

// At later t, with a nearest distance equal to the sphere's, the sphere must be awake.
static void wakes_in_time(const struct meeting *m, struct batch_packet *w, const char *by) {
    for (int i = 0; i < AFTER; i++) {
        float t = m->t + (float)(i < 16 ? i : 1 << (i - 12)) * 0x1p-11f; // to 1 further on
        w->march.t = v_splat(t);
        w->least = known(distance_from(m, (double)t));
        if (awake_candidates(below, 1, w) != 1)
            fail_msg("%s: from t = %a on it sleeps at %a, %g away", by, (double)m->t, (double)t,
                     distance_from(m, (double)t));
    }
}

static void check(double least, double most, double beside) {
    struct shadow_batch batch;
    struct batch_packet *w = &batch.packet[0];
    for (int i = 0; i < PLACES; i++) {
        struct meeting m = meeting_at(least, most, beside);
        set_batch(&batch, &m);
        set_falling_bounds(&batch);
        wakes_in_time(&m, w, "set_falling_bounds");
        set_batch(&batch, &m);
        w->least = known(distance_from(&m, (double)m.t));
        if (sphere_too_far(&shape, w, below))
            fail_msg("sphere_too_far: at %a it is as near as the nearest so far", (double)m.t);
        w->least = known(-1);
        assert_true(sphere_too_far(&shape, w, below)); // or nothing is checked by what follows
        wakes_in_time(&m, w, "sphere_too_far");
    }
}

TEST(early_on_the_way) {
    check(0.001, 1, 0);
    check(0.001, 1, 0.02);
}

TEST(far_on_the_way) {
    check(16, 32, 0);
    check(16, 32, 0.02);
}

TEST(at_the_bounds) {
    check(100, 128, 0);
    check(100, 128, 0.02);
}

RUN_TESTS(NULL, NULL)
