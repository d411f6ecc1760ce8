// What an accepted scene becomes: every value in its place, and the features that follow from them.
#include "near.h"
#include "scene_file.h"

// The plane n·p = 10 with n = (0, 3, 4): the normal becomes a unit vector, the plane stays where it is. What the other
// values become is seen in the pictures of tests/conformance.
TEST(a_plane_has_a_unit_normal) {
    load_whole();
    const struct shape *plane = &scene.model.shapes[5];
    assert_true(near(plane->plane.normal[1], 0.6, 1e-15) && near(plane->plane.offset, 2, 1e-15));
    assert_true(near(plane->plane.normal[2], 0.8, 1e-15));
    scene_free(&scene);
}

TEST(features_are_found) {
    static const struct {
        const char *path, *value;
        bool rotation, repetition, mirrors, fog;
    } cases[] = {{"fog", "1e-5", true, true, true, true},
                 {"fog", "0", true, true, true, false},
                 {"shapes[0].rotation_degrees", "[0,0,0]", false, true, true, true},
                 {"shapes[0].rotation_degrees", "[0,0,-1e-9]", true, true, true, true},
                 {"shapes[0].repeat", "[0,0,0]", true, false, true, true},
                 {"shapes[0].repeat", NULL, true, false, true, true},
                 {"march.max_bounces", "0", true, true, false, true},
                 {"materials.mirror.reflectivity", "0", true, true, false, true},
                 {"materials.unused", "{'color':[1,1,1],'reflectivity':1,'shininess':1}", true,
                  true, true, true}};
    for (size_t i = 0; i < LENGTH(cases); i++) {
        assert_true(accepted(cases[i].path, cases[i].value));
        const struct features *f = &scene.model.features;
        if (f->rotation != cases[i].rotation || f->repetition != cases[i].repetition ||
            f->mirrors != cases[i].mirrors || f->fog != cases[i].fog)
            fail_msg("%s := %s: rotation %d, repetition %d, mirrors %d, fog %d", cases[i].path,
                     cases[i].value, f->rotation, f->repetition, f->mirrors, f->fog);
        scene_free(&scene);
    }
    // A mirror material that no shape uses is not a feature.
    json_t *root = edited("shapes[4]", NULL);
    json_array_remove(json_object_get(root, "shapes"), 7); // the group
    json_array_remove(json_object_get(root, "shapes"), 0);
    assert_true(load_json(root, 0));
    json_decref(root);
    assert_false(scene.model.features.mirrors);
    assert_int_equal(scene.model.features.count[SHAPE_SPHERE], 0);
    scene_free(&scene);
}

// A box without rounding has the plain type, so no phase spends time on rounding that is not there.
TEST(a_box_without_rounding_is_plain) {
    static const char *const none[] = {NULL, "0", "0.0", "-0.0"};
    for (size_t i = 0; i < LENGTH(none); i++) {
        assert_true(accepted("shapes[1].rounding", none[i]));
        assert_int_equal(scene.model.shapes[1].type, SHAPE_BOX);
        assert_true(scene.model.shapes[1].box.rounding == 0);
        assert_int_equal(scene.model.features.count[SHAPE_BOX], 1);
        assert_int_equal(scene.model.features.count[SHAPE_ROUNDED_BOX], 0);
        scene_free(&scene);
    }
}

TEST(overrides_replace) {
    json_t *root = parse(WHOLE);
    char *text = json_dumps(root, 0);
    json_decref(root);
    assert_true(load_bytes(text, strlen(text), &(struct scene_overrides){0.25, 7}));
    free(text);
    assert_true(scene.model.march.hit_distance == 0.25 && scene.model.march.max_steps == 7);
    scene_free(&scene);
}

// The group of WHOLE, in prefix order; its transform is the shape's, its solid is its first member's.
TEST(a_tree_stands_in_prefix_order) {
    static const struct {
        enum operation operation;
        int type, end, children;
    } nodes[] = {{NODE_DIFFERENCE, SHAPE_GROUP, 6, 3},   {NODE_SHAPE, SHAPE_BOX, 2, 0},
                 {NODE_INTERSECTION, SHAPE_GROUP, 5, 2}, {NODE_SHAPE, SHAPE_GYROID, 4, 0},
                 {NODE_SHAPE, SHAPE_ELLIPSOID, 5, 0},    {NODE_SHAPE, SHAPE_CAPSULE, 6, 0}};
    load_whole();
    const struct model *model = &scene.model;
    const struct shape *shape = &model->shapes[8];
    const struct node *root = &model->nodes[0];
    assert_int_equal(model->node_count, LENGTH(nodes));
    for (int i = 0; i < model->node_count; i++) {
        const struct node *node = &model->nodes[i];
        assert_int_equal(node->operation, nodes[i].operation);
        assert_int_equal(node->shape.type, nodes[i].type);
        assert_int_equal(node->end, nodes[i].end);
        assert_int_equal(node->children, nodes[i].children);
    }
    assert_int_equal(shape->type, SHAPE_GROUP);
    assert_true(shape->position[2] == 9 && root->shape.position[2] == 0);
    assert_true(near(root->radius, sqrt(3) + 0.1, 1e-12) && near(root->blend, 0.2, 0));
    assert_true(near(model->nodes[5].lipschitz, 1.03, 1e-12)); // 1 + 0.01·3
    assert_true(
        near(model->nodes[4].growth, 1 / 6., 1e-12)); // 1/3 of an ellipsoid, halved by a twist
    assert_true(model->nodes[1].mirror[0] && !model->nodes[1].mirror[1]);
    assert_true(model->features.groups == 1 && model->features.blends);
    assert_true(model->features.displacements && model->features.twists);
    scene_free(&scene);
}

// A modified shape alone is a group, too. What is repeated jumps at its cells' walls unless it is its mirror image.
TEST(jumps_are_known) {
    static const struct {
        const char *shape;
        bool jumps;
    } cases[] = {
        {"{'type':'capsule','radius':1,'half_height':1,'material':'white'}", false},
        {"{'type':'capsule','radius':1,'half_height':1,'material':'white','repeat':[5,5,5]}",
         false},
        {"{'type':'capsule','radius':1,'half_height':1,'material':'white','repeat':[5,5,5],'twist':"
         "1}",
         true},
        {"{'type':'cone','bottom_radius':1,'top_radius':2,'half_height':1,'shell':0.1,"
         "'material':'white','repeat':[5,0,5]}",
         false},
        {"{'type':'cone','bottom_radius':1,'top_radius':2,'half_height':1,'shell':0.1,"
         "'material':'white','repeat':[0,5,0]}",
         true},
        {"{'type':'group','operation':'union','repeat':[4,0,0],'shapes':"
         "[{'type':'sphere','radius':1,'material':'white'}]}",
         true},
        {"{'type':'group','operation':'union','repeat':[4,0,0],'mirror':'x','shapes':"
         "[{'type':'sphere','radius':1,'material':'white'}]}",
         false},
        {"{'type':'group','operation':'union','shapes':[{'type':'sphere','radius':1,'shell':0.1,"
         "'repeat':[4,0,0],'material':'white','displace':{'amplitude':0.1,'frequency':[1,1,1]}}]}",
         true},
    };
    for (size_t i = 0; i < LENGTH(cases); i++) {
        assert_true(accepted("shapes[0]", cases[i].shape));
        const struct shape *shape = &scene.model.shapes[0];
        assert_int_equal(shape->type, SHAPE_GROUP);
        assert_int_equal(scene.model.nodes[shape->group.root].jumps, cases[i].jumps);
        scene_free(&scene);
    }
}

RUN_TESTS(make_file, remove_file)
