// The part of a group's program that opt7_tiles finds for a bundle of rays gives the whole program's bits wherever the
// rays are: random trees, random bundles. test_group_programs_8.c and test_group_programs_16.c.
#include "tests/c/testing.h"

#pragma GCC diagnostic ignored "-Wunused-function" // of what is included
#include "core/prepare_shape.c"
#include "groups/clusters.c"
#include "groups/compile_groups.c"
#include "groups/field.c"
#include "groups/field_parts.c"
#include "groups/node_shapes.c"
#include "groups/prune.c"
#include "random_from.h"
#include "scene/internal.h"

enum { MOST_NODES = 1200, TREES = 60, BUNDLES = 12, PLACES = 6 };

static struct node nodes[MOST_NODES];
static struct material material = {{1, 1, 1}, 0, 10};

static bool one_in(double many) {
    return random_from(0, many) < 1;
}

static void random_shape(struct node *n, double size) {
    static const enum shape_type types[] = {
        SHAPE_SPHERE, SHAPE_BOX,         SHAPE_TORUS,   SHAPE_CONE,      SHAPE_OCTAHEDRON,
        SHAPE_PLANE,  SHAPE_ROUNDED_BOX, SHAPE_CAPSULE, SHAPE_ELLIPSOID, SHAPE_GYROID};
    struct shape *s = &n->shape;
    s->type = types[(int)random_from(0, LENGTH(types) - 1e-9)];
    for (int k = 0; k < 3;
         k++) // of a box and an ellipsoid; others have two or three numbers in the same place
        s->box.half_size[k] = size * random_from(0.3, 1);
    s->box.rounding = s->type == SHAPE_ROUNDED_BOX ? 0.1 * size : 0;
    if (s->type == SHAPE_PLANE) {
        s->plane.normal[0] = s->plane.normal[2] = 0;
        s->plane.normal[1] = 1;
        s->plane.offset = -size;
    }
}

// Writes a tree from `at` on, with about `count` shapes of it. Returns the index behind it.
static int random_tree(int at, int count, int depth) {
    struct node *n = &nodes[at];
    *n = (struct node){.operation = count == 1 ? NODE_SHAPE : (int)random_from(1, 3.999)};
    n->shape.type = SHAPE_GROUP;
    for (int k = 0; k < 3 && at > 0; k++) {
        n->shape.position[k] = random_from(-2, 2) / depth;
        n->shape.rotation_degrees[k] = one_in(3) ? random_from(-180, 180) : 0;
        n->mirror[k] = one_in(9);
        n->shape.repeat[k] = one_in(40) ? 3 : 0;
    }
    n->amplitude = one_in(6) ? 0.05 : 0;
    n->frequency[0] = n->frequency[1] = n->frequency[2] = 4;
    n->shell = one_in(8) ? 0.05 : 0;
    n->offset = one_in(8) ? random_from(-0.05, 0.1) : 0;
    if (count == 1)
        random_shape(n, 1.2 / depth);
    bool endless = n->shape.type == SHAPE_PLANE || n->shape.type == SHAPE_GYROID;
    n->twist = count == 1 && !endless && one_in(8) ? 0.7 : 0;
    n->blend = count > 1 && one_in(2) ? random_from(0.05, 0.5) : 0;
    int next = at + 1, left = count;
    while (count > 1 && left > 0) {
        int some = depth > 5 || one_in(2) ? 1 : (int)random_from(1, left * 0.7 + 1);
        next = random_tree(next, some < count ? some : count - 1, depth + 1);
        left -= some;
        n->children++;
    }
    return n->end = next;
}

// Many small balls, as a molecule: its program has clusters.
static int crowd(int count) {
    nodes[0] = (struct node){.operation = NODE_UNION, .blend = 0.15, .children = count};
    nodes[0].shape.type = SHAPE_GROUP;
    for (int i = 1; i <= count; i++) {
        nodes[i] = (struct node){.operation = NODE_SHAPE, .end = i + 1};
        nodes[i].shape.sphere.radius = random_from(0.05, 0.3);
        for (int k = 0; k < 3; k++)
            nodes[i].shape.position[k] = random_from(-3, 3);
    }
    return nodes[0].end = count + 1;
}

struct outcome {
    long steps, whole, points;
};

// Holds the bits of random bundles against the whole program's.
static void hold_bundles(const struct prepared *prepared, struct outcome *out) {
    const struct primitive *primitive = prepared->primitives;
    const struct program *whole = primitive->program;
    struct local_ray rays[GROUP] = {0}, *local[GROUP];
    for (int k = 0; k < GROUP; k++)
        local[k] = &rays[k];
    size_t size = (regions_size(&prepared->model, GROUP) + 63) / 64 * 64;
    void *memory = aligned_alloc(64, size);
    assert_non_null(memory);
    place_regions(memory, &prepared->model, local, GROUP);
    for (int round = 0; round < BUNDLES; round++) {
        const struct local_ray *packet[GROUP];
        vfloat t[GROUP];
        vmask live[GROUP];
        int count = 1 + (int)random_from(0, 3.999);
        double middle[3], towards[3], wide = pow(10, random_from(-3, 0)), turn = wide;
        for (int k = 0; k < 3; k++) {
            middle[k] = random_from(-4, 4);
            towards[k] = random_from(-1, 1) - 0.3 * middle[k];
        }
        turn *= random_from(0, 0.5);
        for (int i = 0; i < count; i++) {
            float lanes[6][LANES];
            for (int lane = 0; lane < LANES; lane++) {
                double d[3], square = 0;
                for (int k = 0; k < 3; k++) {
                    lanes[k][lane] = (float)(middle[k] + random_from(-wide, wide));
                    d[k] = towards[k] + random_from(-turn, turn);
                    square += d[k] * d[k];
                }
                for (int k = 0; k < 3; k++)
                    lanes[3 + k][lane] = (float)(d[k] / sqrt(square));
            }
            rays[i].origin = (struct vec){v_load(lanes[0]), v_load(lanes[1]), v_load(lanes[2])};
            rays[i].direction = (struct vec){v_load(lanes[3]), v_load(lanes[4]), v_load(lanes[5])};
            packet[i] = &rays[i];
            t[i] = v_splat((float)random_from(0, 0.2));
            live[i] = v_mask_of_bits((unsigned)random_from(1, (1u << LANES) - 1));
        }
        prune_program(packet, t, live, count, primitive);
        const struct program *part = rays[0].region->owner->program;
        out->steps += part->length;
        out->whole += whole->length;
        for (int i = 0; i < count; i++)
            for (int place = 0; place <= PLACES; place++) {
                vfloat ahead = rays[i].region->until - t[i], both[2];
                vfloat at = v_madd(ahead, v_splat((float)place / PLACES), t[i]);
                struct vec p = vec_along(rays[i].origin, rays[i].direction, at);
                assert_true(
                    region_holds(rays[i].region, v_min(at, rays[i].region->until), live[i]));
                field_values(whole, &p, 1, &both[0]);
                field_values(part, &p, 1, &both[1]);
                vmask same = v_or(v_cmp_eq(both[0], both[1]), v_not(live[i]));
                out->points += v_count(live[i]);
                if (!v_all(same))
                    fail_msg("tree of %d steps, part of %d: another distance", whole->length,
                             part->length);
            }
    }
    free(memory);
}

static void hold_tree(int count, struct outcome *out) {
    struct shape shape = {.type = SHAPE_GROUP};
    struct primitive primitive;
    struct prepared prepared = {.primitives = &primitive};
    prepared.model = (struct model){.shape_count = 1,
                                    .node_count = count,
                                    .shapes = &shape,
                                    .nodes = nodes,
                                    .materials = &material};
    prepared.model.march.bounds_radius = 100;
    prepared.model.march.normal_step = 1e-4;
    prepared.model.features.groups = 1;
    model_bound_nodes(&prepared.model);
    primitive = prepare_shape(0, &shape, &prepared.model.march);
    prepared.groups = groups_reserve(&prepared.model);
    assert_non_null(prepared.groups);
    compile_groups(&prepared);
    hold_bundles(&prepared, out);
    free(prepared.groups);
}

TEST(a_part_has_the_bits_of_the_whole) {
    struct outcome out = {0};
    for (int i = 0; i < MANY(TREES); i++)
        hold_tree(random_tree(0, 3 + i % 20, 1), &out);
    assert_true(out.steps < 0.8 * (double)out.whole);
    assert_true(out.points > MANY(20000));
}

TEST(a_part_of_clusters_has_the_bits_of_the_whole) {
    struct outcome out = {0};
    for (int i = 0; i < MANY(10); i++)
        hold_tree(crowd(100 + 100 * i), &out);
    assert_true(out.steps < 0.3 * (double)out.whole);
}

RUN_TESTS(NULL, NULL)
