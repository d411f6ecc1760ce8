// Where shapes that move on circles and lines are at a given time.
#include "near.h"
#include "scene_file.h"

// At quarters of a period the places are worked out by hand. Between them they are compared with a rotation and a cosine
// of this test. Times before 0 are included.
TEST(shapes_follow_their_paths) {
    load_whole();
    const struct model *still = &scene.model;
    struct model moved;
    assert_true(model_copy(still, &moved));
    struct shape *shapes = moved.shapes;
    // Time in seconds; place on the circle about (0, 1, z), or zeros: not compared; place on the line to (4, −8, 0.5).
    static const double by_hand[][7] = {
        {0, 1, 2, 3, 0, 0, 0},    {1, 0, 0, 0, 4, -8, 0.5},    {2, -1, 2, 3, 0, 0, 0},
        {4, -1, 0, 3, 0, 0, 0},   {6, 1, 0, 3, 0, 0, 0},       {-2, 1, 0, 3, 0, 0, 0},
        {802, -1, 2, 3, 0, 0, 0}, {0.5, 0, 0, 0, 2, -4, 0.25},
    };
    for (size_t i = 0; i < LENGTH(by_hand); i++) {
        const double *row = by_hand[i];
        model_move(still, row[0], &moved);
        if (row[3] != 0)
            assert_memory_equal(shapes[0].position, &row[1], sizeof shapes->position);
        assert_memory_equal(shapes[1].position, &row[4], sizeof shapes->position);
        for (int k = 2; k < 8; k++) // these have no path
            assert_memory_equal(&shapes[k], &still->shapes[k], sizeof *shapes);
        assert_memory_equal(&shapes[0].sphere, &still->shapes[0].sphere, sizeof shapes->sphere);
    }
    for (double t = -3; t < 9; t += 0.37) {
        model_move(still, t, &moved);
        double a = M_PI * t / 4, part = 0.5 - 0.5 * cos(M_PI * t);
        const double *p = shapes[0].position;
        assert_true(near(p[0], cos(a) - sin(a), 1e-14));
        assert_true(near(p[1], 1 + sin(a) + cos(a), 1e-14) && near(p[2], 3, 0));
        p = shapes[1].position;
        assert_true(near(p[0], 4 * part, 1e-14) && near(p[1], -8 * part, 1e-14));
    }
    assert_true(still->features.motion);
    free(shapes);
    scene_free(&scene);
    json_t *root = edited("shapes[0].path", NULL);
    json_object_del(json_array_get(json_object_get(root, "shapes"), 1), "path");
    json_array_remove(json_object_get(root, "shapes"), 8); // a group, of which a member moves
    assert_true(load_json(root, 0));
    json_decref(root);
    assert_false(scene.model.features.motion);
    scene_free(&scene);
}

// The axis is slanted and does not go through the origin. The shape keeps its distance to the axis and its place along it.
TEST(a_circle_keeps_its_distance) {
    assert_true(accepted("shapes[0].path.axis", "[1,-2,2]"));
    const double axis[3] = {1 / 3., -2 / 3., 2 / 3.}, centre[3] = {0, 1, 3};
    struct model moved;
    assert_true(model_copy(&scene.model, &moved));
    struct shape *shapes = moved.shapes;
    double along = -1 / 3., distance = sqrt(17 / 9.); // (1, 1, 0)·axis; its rest: 2 − 1/9
    double turned[3], before[3] = {1, 1, 0};
    for (double t = 0; t < 8; t += 0.5) {
        model_move(&scene.model, t, &moved);
        double from[3], off[3], ahead[3];
        for (int i = 0; i < 3; i++)
            from[i] = shapes[0].position[i] - centre[i];
        assert_true(near(dot3(from, axis), along, 1e-14));
        for (int i = 0; i < 3; i++)
            off[i] = from[i] - along * axis[i];
        assert_true(near(sqrt(dot3(off, off)), distance, 1e-14));
        for (int i = 0; i < 3; i++)
            turned[i] = from[i] - before[i];
        cross3(axis, off, ahead); // right-hand rule: the shape moves along axis × off
        assert_true(t == 0 || dot3(turned, ahead) > 0);
        memcpy(before, from, sizeof before);
    }
    free(shapes);
    scene_free(&scene);
}

// A zero that is written as -0 is read as +0. The shape is at its place at time 0 to the bit, as scene.h promises.
TEST(a_negative_zero_is_zero) {
    assert_true(accepted("shapes[0].position", "[1,-0.0,-1e-400]"));
    const double place[3] = {1, 0, 0};
    assert_memory_equal(scene.model.shapes[0].position, place, sizeof place);
    struct model moved;
    assert_true(model_copy(&scene.model, &moved));
    struct shape *shapes = moved.shapes;
    model_move(&scene.model, 0, &moved);
    assert_memory_equal(shapes[0].position, place, sizeof place);
    free(shapes);
    scene_free(&scene);
}

// A member of a group moves, and the bounds of all nodes are those of a scene in which it stands where it is then.
TEST(a_groups_members_move) {
    load_whole();
    struct model moved;
    assert_true(model_copy(&scene.model, &moved));
    model_move(&scene.model, 1.5, &moved); // half of its period
    assert_true(moved.nodes[4].shape.position[0] == 1);
    assert_true(scene.model.nodes[4].shape.position[0] == 0);
    scene_free(&scene);
    assert_true(accepted("shapes[8].shapes[1].shapes[1]",
                         "{'type':'ellipsoid','radius':[1,2,3],'material':'mirror','twist':0.5,"
                         "'position':[1,0,0]}"));
    for (int i = 0; i < moved.node_count; i++) {
        const struct node *a = &moved.nodes[i], *b = &scene.model.nodes[i];
        assert_memory_equal(a->centre, b->centre, sizeof a->centre);
        assert_true(a->radius == b->radius && a->lipschitz == b->lipschitz);
        assert_true(a->twist_radius == b->twist_radius && a->growth == b->growth);
    }
    free(moved.shapes);
    scene_free(&scene);
}

RUN_TESTS(make_file, remove_file)
