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

RUN_TESTS(make_file, remove_file)
