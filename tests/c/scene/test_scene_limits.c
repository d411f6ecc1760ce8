// Limits of the values in a scene. A value beyond a limit is refused with its path; the limit itself is accepted.
#include "scene_file.h"

struct bad_value {
    const char *path, *value, *at, *message; // the arguments of refused()
};

static void all_refused(const struct bad_value *cases, size_t count) {
    for (size_t i = 0; i < count; i++)
        refused(cases[i].path, cases[i].value, cases[i].at, cases[i].message);
}

static void limits_of_views_and_lights_are_refused(void **state) {
    (void)state;
    static const struct bad_value cases[] = {
        {"camera.vertical_fov_degrees", "0.99", NULL, "0.99 is not in 1 to 170 degrees"},
        {"camera.vertical_fov_degrees", "171", NULL, "171 is not in 1 to 170 degrees"},
        {"camera.look_at", "[1,2,3]", NULL, "is the camera's position; it must differ from it"},
        {"camera.up", "[0,0,0]", NULL, "is zero or parallel to the direction of view"},
        {"camera.up", "[6,-6,12]", NULL, "is zero or parallel to the direction of view"},
        {"camera.up", "[-3,3,-6]", NULL, "is zero or parallel to the direction of view"},
        {"camera.position", "[1,2]", NULL, "2 numbers where exactly 3 are required"},
        {"camera.position", "[1,2,3,4]", NULL, "4 numbers where exactly 3 are required"},
        {"camera.position[1]", "1.5e9", NULL,
         "1.5e+09 is beyond 1e+09, the largest number there is"},
        {"light.shadows", "'Soft'", NULL,
         "\"Soft\" is not one of \"soft\", \"ideal\", \"hard\", \"none\""},
        {"light.shadow_strength", "0", NULL, "0 is not > 0"},
        {"light.shadow_strength", "-3", NULL, "-3 is not > 0"},
        {"light.emission[2]", "-0.5", NULL, "-0.5 is not >= 0"},
        {"background[0]", "-1", NULL, "-1 is not >= 0"},
        {"fog", "-1e-6", NULL, "-1e-06 is not >= 0"},
    };
    all_refused(cases, COUNT(cases));
}

static void limits_of_marches_and_materials_are_refused(void **state) {
    (void)state;
    static const struct bad_value cases[] = {
        {"march.max_steps", "0", NULL, "0 is not >= 1"},
        {"march.max_steps", "2.5", NULL, "2.5 is not a whole number"},
        {"march.max_steps", "1e300", NULL, "1e+300 is beyond 1000000000, the largest there is"},
        {"march.max_bounces", "257", NULL, "257 is beyond 256, the largest there is"},
        {"march.hit_distance", "0", NULL, "0 is not > 0"},
        {"march.hit_distance", "-1e-6", NULL, "-1e-06 is not > 0"},
        {"march.bounds_radius", "0", NULL, "0 is not > 0"},
        {"march.max_bounces", "-1", NULL, "-1 is not >= 0"},
        {"march.max_bounces", "0.5", NULL, "0.5 is not a whole number"},
        {"march.normal_step", "0", NULL, "0 is not > 0"},
        {"march.surface_offset", "0", NULL, "0 is not > 0"},
        {"materials.white.color[1]", "-0.1", NULL, "-0.1 is not >= 0"},
        {"materials.white.reflectivity", "-0.1", NULL, "-0.1 is not in 0 to 1"},
        {"materials.white.reflectivity", "1.1", NULL, "1.1 is not in 0 to 1"},
        {"materials.white.shininess", "0", NULL, "0 is not > 0"},
        {"materials.white", NULL, "shapes[1].material", "\"white\" is not defined in $.materials"},
        {"shapes[4].material", "'gold'", NULL, "\"gold\" is not defined in $.materials"},
    };
    all_refused(cases, COUNT(cases));
}

static void limits_of_shapes_are_refused(void **state) {
    (void)state;
    static const struct bad_value cases[] = {
        {"shapes", "[]", NULL, "0 shapes; 1 to 4096 are allowed"},
        {"shapes[2].type", "'donut'", NULL,
         "\"donut\" is not a shape; there are sphere, box, torus, cone, octahedron, plane, "
         "mandelbulb, mandelbox"},
        {"shapes[0].radius", "0", NULL, "0 is not > 0"},
        {"shapes[0].radius", "-1", NULL, "-1 is not > 0"},
        {"shapes[0].repeat[1]", "-2", NULL, "-2 is not >= 0"},
        {"shapes[0].repeat[1]", "1e-40", NULL, "1e-40 is neither 0 nor a cell of at least 1e-09"},
        {"shapes[1].half_size[2]", "0", NULL, "0 is not > 0"},
        {"shapes[1].rounding", "-0.1", NULL, "-0.1 is not >= 0"},
        {"shapes[1].rounding", "1e-12", NULL, "1e-12 is neither 0 nor a radius of at least 1e-09"},
        {"shapes[0].rounding", "0.1", NULL,
         "unknown key; known here: type, material, position, rotation_degrees, repeat, path, "
         "radius"},
        {"shapes[1].type", "'rounded box'", NULL,
         "\"rounded box\" is not a shape; there are sphere, box, torus, cone, octahedron, plane, "
         "mandelbulb, mandelbox"},
        {"shapes[2].major_radius", "0", NULL, "0 is not > 0"},
        {"shapes[2].minor_radius", "-0.5", NULL, "-0.5 is not > 0"},
        {"shapes[3].bottom_radius", "0", NULL, "0 is not > 0"},
        {"shapes[3].top_radius", "0", NULL, "0 is not > 0"},
        {"shapes[3].half_height", "-3", NULL, "-3 is not > 0"},
        {"shapes[3].radius", "1", NULL,
         "unknown key; known here: type, material, position, rotation_degrees, repeat, path, "
         "bottom_radius, top_radius, half_height"},
        {"shapes[4].radius", "0", NULL, "0 is not > 0"},
        {"shapes[5].normal", "[0,0,0]", NULL, "is zero; a direction is required"},
        {"shapes[5].normal", "[0,1e-300,0]", NULL, "is zero; a direction is required"},
        {"shapes[6].power", "7", NULL, "7 is not 8, the only power there is a map for"},
        {"shapes[6].iterations", "0", NULL, "0 is not >= 1"},
        {"shapes[6].iterations", "1001", NULL, "1001 is beyond 1000, the largest there is"},
        {"shapes[6].iterations", "1.5", NULL, "1.5 is not a whole number"},
        {"shapes[6].bailout", "3.9", NULL, "3.9 is not in 4 to 10000"},
        {"shapes[6].bailout", "10001", NULL, "10001 is not in 4 to 10000"},
        {"shapes[7].scale", "0", NULL, "0 should be 1e-09 or more, or -1e-09 or less"},
        {"shapes[7].scale", "-1e-10", NULL, "-1e-10 should be 1e-09 or more, or -1e-09 or less"},
        {"shapes[7].scale", "2e9", NULL, "2e+09 is beyond 1e+09, the largest number there is"},
        {"shapes[7].fold_limit", "0", NULL, "0 is not > 0"},
        {"shapes[7].minimum_radius", "0", NULL, "0 is not > 0"},
        {"shapes[7].minimum_radius", "2.5", NULL,
         "2.5 is not between fixed_radius/100 and fixed_radius, 2"},
        {"shapes[7].minimum_radius", "0.01", NULL,
         "0.01 is not between fixed_radius/100 and fixed_radius, 2"},
        {"shapes[7].fixed_radius", "0", NULL, "0 is not > 0"},
        {"shapes[7].iterations", "0", NULL, "0 is not >= 1"},
        {"shapes[7].iterations", "101", NULL, "101 is beyond 100, the largest there is"},
        // 1.5^35 is 1.5e6; (1.5·16)^22 is 2.3e30
        {"shapes[7].iterations", "35", NULL,
         "|scale|^iterations is 1.45611e+06, beyond 1e6: at most 34 for this scale"},
        {"shapes[7].iterations", "22", NULL,
         "(|scale|*(fixed_radius/minimum_radius)^2)^iterations is 2.31551e+30, beyond 1e30: at "
         "most 21 for these numbers"},
        {"shapes[7].power", "8", NULL,
         "unknown key; known here: type, material, position, rotation_degrees, repeat, path, "
         "scale, fold_limit, minimum_radius, fixed_radius, iterations"},
    };
    all_refused(cases, COUNT(cases));
}

static void limits_of_paths_are_refused(void **state) {
    (void)state;
    static const struct bad_value cases[] = {
        {"shapes[0].path.type", "'spiral'", NULL, "\"spiral\" is not one of \"circle\", \"line\""},
        {"shapes[0].path.period", "0", NULL, "0 is not > 0"},
        {"shapes[0].path.period", "-1", NULL, "-1 is not > 0"},
        {"shapes[0].path.axis", "[0,0,0]", NULL, "is zero; a direction is required"},
        {"shapes[0].path.centre", "[1,2,-70]", NULL,
         "the position is on the circle's axis; it would not move"},
        {"shapes[0].path.centre", "[1e9,0,0]", NULL,
         "the circle leads beyond 1e+09, the largest number there is"},
        {"shapes[0].path.to", "[1,1,1]", NULL,
         "unknown key; known here: type, period, centre, axis"},
        {"shapes[1].path.axis", "[1,1,1]", NULL, "unknown key; known here: type, period, to"},
        {"camera.path.type", "'point'", NULL, "\"point\" is not one of \"circle\", \"line\""},
        {"camera.path.to", "[1,2,3]", NULL, "is the position itself; it must differ from it"},
        {"shapes[1].path.to", "[0,-0.0,0]", NULL, "is the position itself; it must differ from it"},
    };
    all_refused(cases, COUNT(cases));
}

static void limits_themselves_are_accepted(void **state) {
    (void)state;
    static const char *const cases[][2] = {
        {"camera.vertical_fov_degrees", "1"},
        {"camera.vertical_fov_degrees", "170"},
        {"camera.path", NULL},
        {"camera.path", "{'type':'circle','period':1,'centre':[0,0,0],'axis':[0,1,0]}"},
        {"light.emission", "[0,0,0]"},
        {"light.shadows", "'none'"},
        {"light.shadows", "'soft'"},
        {"light.shadows", "'ideal'"},
        {"fog", "0"},
        {"march.max_steps", "1"},
        {"march.max_steps", "7.0"},
        {"march.max_bounces", "0"},
        {"materials.white.reflectivity", "1"},
        {"materials.white.color", "[0,0,0]"},
        {"shapes[0].radius", "1e-9"},
        {"shapes[0].radius", "1e9"},
        {"shapes[5].offset", "-1e9"},
        {"shapes[6].iterations", "1"},
        {"shapes[6].bailout", "4"},
        {"shapes[6].bailout", "10000"},
        {"shapes[7].scale", "1e-9"},
        {"shapes[7].scale", "-1"},
        {"shapes[7].iterations", "21"},
        {"shapes[7].minimum_radius", "0.3125"},
        {"shapes[7].minimum_radius", "2"},
        {"shapes[0].position", NULL},
        {"shapes[0].rotation_degrees", NULL},
        {"shapes[0].repeat", NULL},
        {"shapes[0].path", NULL},
        {"shapes[0].path.period", "1e-9"},
        {"shapes[1].path.to", "[0,1e-300,0]"},
        {"shapes[1].path.to", "[1e9,-1e9,1e9]"},
        {"shapes[0].rotation_degrees", "[0,0,0]"},
        {"shapes[0].repeat", "[0,0,0]"},
        {"shapes[1].rounding", NULL},
        {"shapes[1].rounding", "0"},
        {"shapes[1].rounding", "1e-9"},
        {"shapes[1].rounding", "1e9"},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        if (!accepted(cases[i][0], cases[i][1]))
            fail_msg("%s := %s was refused: %s", cases[i][0], cases[i][1], error);
        scene_free(&scene);
    }
}

static void counts_of_shapes(void **state) {
    (void)state;
    for (int count = 4095; count <= 5000; count += count < 4097 ? 1 : 903) {
        json_t *root = edited("shapes", "[]");
        for (int i = 0; i < count; i++)
            json_array_append_new(json_object_get(root, "shapes"),
                                  parse("{'type':'sphere','radius':1,'material':'white'}"));
        bool loaded = load_json(root, JSON_COMPACT);
        json_decref(root);
        assert_int_equal(loaded, count <= 4096);
        if (loaded) {
            assert_int_equal(scene.model.shape_count, count);
            scene_free(&scene);
        } else {
            char expected[256];
            snprintf(expected, sizeof expected, "%s: $.shapes: %d shapes; 1 to 4096 are allowed",
                     file_name, count);
            assert_string_equal(error, expected);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(limits_of_views_and_lights_are_refused),
        cmocka_unit_test(limits_of_marches_and_materials_are_refused),
        cmocka_unit_test(limits_of_shapes_are_refused),
        cmocka_unit_test(limits_of_paths_are_refused),
        cmocka_unit_test(limits_themselves_are_accepted),
        cmocka_unit_test(counts_of_shapes),
    };
    return cmocka_run_group_tests_name("scene_limits", tests, make_file, remove_file);
}
