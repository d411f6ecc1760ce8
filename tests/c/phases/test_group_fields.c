// flags: -O2 -iquote truth
// Fields of random trees of nodes: what truth's intervals say of a piece of a ray holds the values and the slopes of
// chords that double-double has there, in doubles and in quads, in any order of pieces.
#include "tests/c/testing.h"

#include "scene/internal.h"
#include "tests/c/phases/random_from.h"
#include "truth/groups/field.c"
#include "truth/groups/sdf_group.c"
#include "truth/number/angles.c"
#include "truth/sdf.c"

enum { TREES = MANY(250), MOST = 64 };

struct tree {
    struct node nodes[MOST];
    struct solid inside[MOST], group;
    struct shape shape;
    int count;
};

static bool chance(double share) {
    return random_from(0, 1) < share;
}

static void random_solid(struct shape *s) {
    static const int types[] = {SHAPE_SPHERE,     SHAPE_BOX,   SHAPE_TORUS,       SHAPE_CONE,
                                SHAPE_OCTAHEDRON, SHAPE_PLANE, SHAPE_ROUNDED_BOX, SHAPE_CAPSULE,
                                SHAPE_ELLIPSOID,  SHAPE_GYROID};
    double a = random_from(0.3, 1), b = random_from(0.3, 1), c = random_from(0.3, 1);
    s->type = (enum shape_type)types[(int)random_from(0, LENGTH(types))];
    switch ((int)s->type) {
    case SHAPE_BOX:
    case SHAPE_ROUNDED_BOX:
        s->box.rounding = s->type == SHAPE_BOX ? 0 : a / 4;
        memcpy(s->box.half_size, (double[3]){a, b, c}, sizeof s->box.half_size);
        break;
    case SHAPE_TORUS: s->torus.major_radius = a, s->torus.minor_radius = a * b / 2; break;
    case SHAPE_CONE:
        s->cone.bottom_radius = a, s->cone.top_radius = chance(0.3) ? a : b;
        s->cone.half_height = c;
        break;
    case SHAPE_PLANE:
        s->plane.normal[1] = 0.6, s->plane.normal[2] = 0.8, s->plane.offset = a;
        break;
    case SHAPE_CAPSULE: s->capsule.radius = a / 2, s->capsule.half_height = b; break;
    case SHAPE_ELLIPSOID:
        memcpy(s->ellipsoid.radius, (double[3]){a, b, c}, sizeof s->ellipsoid.radius);
        break;
    case SHAPE_GYROID: s->gyroid.cell = 1 + a, s->gyroid.thickness = b / 4; break;
    default: s->sphere.radius = a; // and an octahedron's
    }
}

static void turn(const double degrees[3], struct solid *solid) {
    static const int pair[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    for (int i = 0; i < 9; i++)
        solid->rotation_q[i / 3][i % 3] = point_q(i % 4 == 0);
    for (int axis = 0; axis < 3; axis++) {
        struct ivq s, c, *u = solid->rotation_q[pair[axis][0]],
                         *v = solid->rotation_q[pair[axis][1]];
        sine_cosine_q(degrees[axis], &s, &c);
        for (int j = 0; j < 3; j++) {
            struct ivq old = u[j];
            u[j] = sub_q(mul_q(c, old), mul_q(s, v[j]));
            v[j] = add_q(mul_q(s, old), mul_q(c, v[j]));
        }
    }
    for (int i = 0; i < 9; i++) {
        solid->rotation_d[i / 3][i % 3] = narrow(solid->rotation_q[i / 3][i % 3]);
        solid->rotation[i / 3][i % 3] = dd_from_quad(mid_q(solid->rotation_q[i / 3][i % 3]));
    }
}

static void random_node(struct tree *tree, int depth) {
    int index = tree->count++;
    struct node *node = &tree->nodes[index];
    struct solid *solid = &tree->inside[index];
    *node = (struct node){.operation = NODE_SHAPE};
    *solid = (struct solid){.shape = &node->shape, .rotated = depth > 0 && chance(0.3)};
    for (int i = 0; i < 3 && depth > 0; i++) {
        node->shape.position[i] = random_from(-1, 1);
        node->shape.rotation_degrees[i] = solid->rotated ? random_from(-180, 180) : 0;
        node->shape.repeat[i] = chance(0.03) ? 2.5 : 0;
        node->mirror[i] = chance(0.1);
    }
    turn(node->shape.rotation_degrees, solid);
    node->shell = chance(0.1) ? 0.1 : 0;
    node->offset = chance(0.2) ? random_from(-0.1, 0.2) : 0;
    node->amplitude = chance(0.15) ? 0.1 : 0;
    for (int i = 0; i < 3; i++)
        node->frequency[i] = random_from(2, 6);
    if (depth < 3 && (depth == 0 || chance(0.5))) {
        node->operation = (enum operation)(NODE_UNION + (int)random_from(0, 3));
        node->children = 1 + (int)random_from(0, depth == 0 ? 6 : 3);
        node->blend = chance(0.5) ? random_from(0.01, 0.6) : 0;
        for (int i = 0; i < node->children; i++)
            random_node(tree, depth + 1);
    } else
        random_solid(&node->shape);
    node->end = tree->count;
    node_bound(tree->nodes, index);
    if (chance(0.1) && isfinite(node->radius)) {
        node->twist = random_from(-2, 2);
        node_bound(tree->nodes, index);
    }
}

static quad whole(struct dd x) {
    return (quad)x.hi + (quad)x.lo;
}

static quad value(const struct tree *tree, const double o[3], const double d[3], double s) {
    struct dd p[3];
    for (int i = 0; i < 3; i++)
        p[i] = dd_add(dd_from(o[i]), exact_product(d[i], s));
    return whole(field_at(&tree->group, p));
}

// Checks both enclosures of the piece at `count` places of it. slack: of double-doubles, in which the values are. A
// rotation of a jumping field may round a point over its border.
static void check(const struct tree *tree, struct field_d *in_d, struct field_q *in_q,
                  const double o[3], const double d[3], double lo, double hi) {
    enum { PLACES = 4 };
    const quad slack = 0x1p-88;
    double m = lo + (hi - lo) * random_from(0.2, 0.8), before_s = m;
    quad here = value(tree, o, d, m), before = here;
    struct jet_d a = field_over_d(in_d, lo, m, hi);
    struct jet_q b = field_over_q(in_q, lo, m, hi);
    assert_true((quad)a.at.lo - slack <= here && here <= (quad)a.at.hi + slack);
    assert_true(b.at.lo - slack <= here && here <= b.at.hi + slack);
    assert_true(a.at.hi - a.at.lo < 1e-11 || a.rough);
    for (int i = 0; i < PLACES; i++) {
        double s = i < 2 ? (i ? hi : lo) : lo + (hi - lo) * random_from(0, 1);
        quad f = value(tree, o, d, s), run = (quad)s - (quad)before_s;
        quad room = slack / (run < 0 ? -run : run);
        assert_true((quad)a.over.lo - slack <= f && f <= (quad)a.over.hi + slack);
        assert_true(b.over.lo - slack <= f && f <= b.over.hi + slack);
        if (run != 0) {
            quad slope = (f - before) / run;
            assert_true((quad)a.slope.lo - room <= slope && slope <= (quad)a.slope.hi + room);
            assert_true(b.slope.lo - room <= slope && slope <= b.slope.hi + room);
        }
        before = f;
        before_s = s;
    }
}

TEST(test_pieces_of_rays_are_enclosed) {
    static struct tree tree;
    for (int round = 0; round < TREES; round++) {
        tree.count = 0;
        random_node(&tree, 0);
        tree.shape = (struct shape){.type = SHAPE_GROUP, .group.root = 0};
        tree.group =
            (struct solid){.shape = &tree.shape, .nodes = tree.nodes, .inside = tree.inside};
        double o[3], d[3];
        struct ray_d ray_d;
        struct ray_q ray_q;
        for (int i = 0; i < 3; i++) {
            o[i] = random_from(-2, 2);
            d[i] = chance(0.2) ? 0 : random_from(-1, 1);
            ray_d.o[i] = point_d(o[i]), ray_d.d[i] = point_d(d[i]);
            ray_q.o[i] = point_q(o[i]), ray_q.d[i] = point_q(d[i]);
        }
        struct field_d *in_d = field_open_d(&tree.group, &ray_d, false);
        struct field_q *in_q = field_open_q(&tree.group, &ray_q, false);
        double lo = random_from(-2, 0), size = random_from(0, 1) < 0.5 ? 2 : 0.25, hi = lo + size;
        for (int i = 0; i < 12; i++) { // into a half, and at times out of it again
            check(&tree, in_d, in_q, o, d, lo, hi);
            double half = (hi - lo) / 2;
            if (chance(0.25)) {
                lo = chance(0.5) ? hi : lo - 2 * half;
                hi = lo + 2 * half;
            } else if (chance(0.5))
                lo += half;
            else
                hi = lo + half;
        }
        field_close_d(in_d);
        assert_true(field_close_q(in_q) == 12);
    }
}

RUN_TESTS(NULL, NULL)
