// What an accepted scene becomes: every value in its place, and the features that follow from them.
#include "near.h"
#include "scene_file.h"

TEST(types_and_materials_of_shapes_arrive) {
    load_whole();
    const struct model *m = &scene.model;
    static const enum shape_type types[] = {SHAPE_SPHERE,     SHAPE_ROUNDED_BOX, SHAPE_TORUS,
                                            SHAPE_CONE,       SHAPE_OCTAHEDRON,  SHAPE_PLANE,
                                            SHAPE_MANDELBULB, SHAPE_MANDELBOX};
    assert_int_equal(m->shape_count, 8);
    assert_int_equal(m->material_count, 2);
    for (int i = 0; i < 8; i++) {
        assert_int_equal(m->shapes[i].type, types[i]);
        assert_int_equal(m->features.count[types[i]], 1);
        assert_int_equal(m->shapes[i].material, i == 0 || i == 4);
    }
    scene_free(&scene);
}

TEST(places_and_paths_of_shapes_arrive) {
    load_whole();
    const struct shape *s = scene.model.shapes;
    assert_memory_equal(s[0].position, ((double[]){1, 2, 3}), sizeof s->position);
    assert_memory_equal(s[0].rotation_degrees, ((double[]){10, 20, 30}), sizeof s->position);
    assert_memory_equal(s[0].repeat, ((double[]){4, 0, 5}), sizeof s->position);
    assert_int_equal(s[0].path.type, PATH_CIRCLE);
    assert_memory_equal(s[0].path.axis, ((double[]){0, 0, 1}), sizeof s->position);
    assert_memory_equal(s[0].path.foot, ((double[]){0, 1, 3}), sizeof s->position);
    assert_int_equal(s[1].path.type, PATH_LINE);
    assert_memory_equal(s[1].path.to, ((double[]){4, -8, 0.5}), sizeof s->position);
    assert_true(s[0].path.period == 8 && s[1].path.period == 2);
    for (int i = 2; i < 8; i++)
        assert_int_equal(s[i].path.type, PATH_NONE);
    for (int i = 1; i < 8; i++) { // these leave them out: zero
        assert_memory_equal(s[i].position, ((double[]){0, 0, 0}), sizeof s->position);
        assert_memory_equal(s[i].rotation_degrees, ((double[]){0, 0, 0}), sizeof s->position);
        assert_memory_equal(s[i].repeat, ((double[]){0, 0, 0}), sizeof s->position);
    }
    scene_free(&scene);
}

TEST(sizes_of_shapes_arrive) {
    load_whole();
    const struct shape *s = scene.model.shapes;
    assert_true(s[0].sphere.radius == 1.5 && s[4].octahedron.radius == 1.25);
    assert_memory_equal(s[1].box.half_size, ((double[]){1, 2, 3}), sizeof s->position);
    assert_true(s[1].box.rounding == 0.25);
    assert_true(s[2].torus.major_radius == 2 && s[2].torus.minor_radius == 0.5);
    assert_true(s[3].cone.bottom_radius == 2 && s[3].cone.top_radius == 1);
    assert_true(s[3].cone.half_height == 3);
    assert_true(s[6].mandelbulb.power == 8 && s[6].mandelbulb.bailout == 256);
    assert_int_equal(s[6].mandelbulb.iterations, 4);
    assert_true(s[7].mandelbox.scale == -1.5 && s[7].mandelbox.fold_limit == 1);
    assert_true(s[7].mandelbox.minimum_radius == 0.5 && s[7].mandelbox.fixed_radius == 2);
    assert_int_equal(s[7].mandelbox.iterations, 16);
    // The plane n·p = 10 with n = (0, 3, 4): the normal becomes a unit vector, the plane stays where it is.
    assert_true(near(s[5].plane.normal[0], 0, 0) && near(s[5].plane.normal[1], 0.6, 1e-15));
    assert_true(near(s[5].plane.normal[2], 0.8, 1e-15) && near(s[5].plane.offset, 2, 1e-15));
    scene_free(&scene);
}

TEST(values_beside_shapes_arrive) {
    load_whole();
    const struct model *m = &scene.model;
    const struct view *v = &scene.view;
    assert_memory_equal(m->materials[0].color, ((double[]){1, 0.9, 0.8}), sizeof m->background);
    assert_true(m->materials[1].reflectivity == 0.5 && m->materials[1].shininess == 20);
    assert_memory_equal(m->background, ((double[]){0.1, 0.2, 0.3}), sizeof m->background);
    assert_true(m->fog == 1e-5 && m->shadows == SHADOWS_HARD && m->shadow_strength == 3);
    assert_true(m->march.max_steps == 300 && m->march.hit_distance == 1e-6);
    assert_true(m->march.bounds_radius == 100 && m->march.max_bounces == 2);
    assert_true(m->march.normal_step == 1e-4 && m->march.surface_offset == 1e-3);
    assert_memory_equal(v->position, ((double[]){1, 2, 3}), sizeof v->position);
    assert_memory_equal(v->light_position, ((double[]){5, 6, 7}), sizeof v->position);
    assert_memory_equal(v->light_emission, ((double[]){8, 9, 10}), sizeof v->position);
    assert_true(near(v->tan_half_fov, 0.36397023426620234, 1e-15)); // tan 20°
    assert_memory_equal(scene.name, file_name + 5,
                        strlen(file_name + 5) - 5); // no folder, no ending
    assert_string_equal(shape_type_name(SHAPE_CONE), "cone");
    assert_string_equal(shadows_name(SHADOWS_SOFT), "soft");
    assert_string_equal(shadows_name(SHADOWS_IDEAL), "ideal");
    scene_free(&scene);
}

TEST(features_are_found) {
    static const struct {
        const char *path, *value;
        bool rotation, repetition, mirrors, fog;
    } cases[] = {
        {"fog", "1e-5", true, true, true, true},
        {"fog", "0", true, true, true, false},
        {"shapes[0].rotation_degrees", "[0,0,0]", false, true, true, true},
        {"shapes[0].rotation_degrees", "[0,0,-1e-9]", true, true, true, true},
        {"shapes[0].repeat", "[0,0,0]", true, false, true, true},
        {"shapes[0].repeat", NULL, true, false, true, true},
        {"march.max_bounces", "0", true, true, false, true},
        {"materials.mirror.reflectivity", "0", true, true, false, true},
        {"materials.unused", "{'color':[1,1,1],'reflectivity':1,'shininess':1}", true, true, true,
         true},
    };
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
