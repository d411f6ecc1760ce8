// Limits of the values in a scene. A value beyond a limit is refused with its path; the limit itself is accepted.
#include "scene_file.h"

// A path, and values.
typedef const char *const limits[6];

TEST(values_beyond_a_limit_are_refused) {
    static limits cases[] = {
        {"camera.vertical_fov_degrees", "0.99", "171"},
        {"camera.look_at", "[1,2,3]"},
        {"camera.up", "[0,0,0]", "[6,-6,12]"},
        {"camera.position", "[1,2]", "[1,2,3,4]"},
        {"camera.position[1]", "1.5e9"},
        {"light.shadows", "'Soft'"},
        {"light.shadow_strength", "0"},
        {"light.emission[2]", "-0.5"},
        {"background[0]", "-1"},
        {"fog", "-1e-6"},
        {"march.max_steps", "0", "2.5", "1e300"},
        {"march.max_bounces", "257", "0.5"},
        {"march.hit_distance", "0"},
        {"march.bounds_radius", "0"},
        {"march.normal_step", "0"},
        {"march.surface_offset", "0"},
        {"materials.white.color[1]", "-0.1"},
        {"materials.white.reflectivity", "-0.1", "1.1"},
        {"materials.white.shininess", "0"},
        {"shapes[4].material", "'gold'"},
        {"shapes", "[]"},
        {"shapes[2].type", "'donut'"},
        {"shapes[0].radius", "0"},
        {"shapes[0].repeat[1]", "-2", "1e-40"},
        {"shapes[1].half_size[2]", "0"},
        {"shapes[1].rounding", "-0.1", "1e-12"},
        {"shapes[0].rounding", "0.1"},
        {"shapes[2].minor_radius", "-0.5"},
        {"shapes[3].top_radius", "0"},
        {"shapes[3].half_height", "-3"},
        {"shapes[3].radius", "1"},
        {"shapes[4].radius", "0"},
        {"shapes[5].normal", "[0,0,0]", "[0,1e-300,0]"},
        {"shapes[6].power", "7"},
        {"shapes[6].iterations", "0", "1001", "1.5"},
        {"shapes[6].bailout", "3.9"},
        {"shapes[7].scale", "0", "-1e-10", "2e9"},
        {"shapes[7].fold_limit", "0"},
        {"shapes[7].minimum_radius", "0", "2.5", "0.01"},
        {"shapes[7].iterations", "0", "101", "35", "22"},
        {"shapes[7].power", "8"},
        {"shapes[0].path.type", "'spiral'"},
        {"shapes[0].path.period", "0"},
        {"shapes[0].path.axis", "[0,0,0]"},
        {"shapes[0].path.centre", "[1,2,-70]", "[1e9,0,0]"},
        {"shapes[0].path.to", "[1,1,1]"},
        {"shapes[1].path.axis", "[1,1,1]"},
        {"camera.path.type", "'point'"},
        {"camera.path.to", "[1,2,3]"},
        {"shapes[1].path.to", "[0,-0.0,0]"},
        {"shapes[0].twist", "2e9"},
        {"shapes[6].twist", "1"},
        {"shapes[8].operation", "'Union'", "'xor'"},
        {"shapes[8].blend", "-0.1", "1e-12"},
        {"shapes[8].material", "'white'"},
        {"shapes[8].shapes", "[]"},
        {"shapes[8].shapes[1]", "1"},
        {"shapes[8].shapes[0].mirror", "'xx'", "'w'"},
        {"shapes[8].shapes[0].shell", "0"},
        {"shapes[8].shapes[0].material", "'gold'"},
        {"shapes[8].shapes[1].shapes[0].thickness", "0"},
        {"shapes[8].shapes[1].shapes[0].twist", "1"},
        {"shapes[8].shapes[1].shapes[1].radius", "[1,1,2000]", "1"},
        {"shapes[8].shapes[1].shapes[1].twist", "1000"},
        {"shapes[8].shapes[2].displace.frequency", "[1,1]"},
        {"shapes[8].shapes[2].displace.frequency[2]", "0"},
        {"shapes[8].shapes[2].displace.amplitude", "-1"},
        {"shapes[8].shapes[2].half_height", "0"},
    };
    for (size_t i = 0; i < LENGTH(cases); i++)
        for (size_t k = 1; cases[i][k]; k++)
            refused(cases[i][0], cases[i][k], NULL, NULL);
    refused("materials.white", NULL, "shapes[1].material", NULL);
    refused("shapes[8].shapes[2]",
            "{'type':'mandelbulb','power':8,'iterations':4,'bailout':256,'material':'white'}",
            "shapes[8].shapes[2].type", NULL);
    refused("shapes[8].shapes[2].displace.frequency[2]", "1e7", "shapes[8].shapes[2].displace",
            NULL);
    refused("shapes[0]", "{'type':'gyroid','cell':1,'thickness':0.2,'material':'white'}", NULL,
            NULL);
    refused("shapes[8].shapes[0]",
            "{'type':'plane','normal':[0,1,0],'offset':0,'twist':1,'material':'white'}",
            "shapes[8].shapes[0].twist", NULL);
}

// Groups nest to a depth of 32, and all groups and their shapes are 4096 at most.
TEST(trees_have_a_size) {
    for (int depth = 32; depth <= 33; depth++) {
        json_t *root = edited("shapes", "[]"), *shapes = json_object_get(root, "shapes");
        for (int i = 0; i < depth; i++) {
            json_array_append_new(shapes,
                                  parse("{'type':'group','operation':'union','shapes':[]}"));
            shapes = json_object_get(json_array_get(shapes, 0), "shapes");
        }
        json_array_append_new(shapes, parse("{'type':'sphere','radius':1,'material':'white'}"));
        bool loaded = load_json(root, JSON_COMPACT);
        assert_int_equal(loaded, depth == 32);
        if (loaded) {
            assert_int_equal(scene.model.node_count, 33);
            scene_free(&scene);
        } else
            assert_non_null(strstr(error, "$.shapes[0].shapes[0].shapes[0]"));
        json_decref(root);
    }
    for (int count = 4095; count <= 4096; count++) { // and the group itself
        json_t *root = edited("shapes[8].shapes", "[]");
        json_t *group = json_array_get(json_object_get(root, "shapes"), 8);
        for (int i = 0; i < count; i++)
            json_array_append_new(json_object_get(group, "shapes"),
                                  parse("{'type':'sphere','radius':1,'material':'white'}"));
        assert_int_equal(load_json(root, JSON_COMPACT), count == 4095);
        if (count == 4095)
            scene_free(&scene);
        else
            assert_non_null(strstr(error, "$.shapes[8].shapes[4095]: "));
        json_decref(root);
    }
}

static void must_be_accepted(const char *path, const char *value) {
    if (!accepted(path, value))
        fail_msg("%s := %s was refused: %s", path, value, error);
    scene_free(&scene);
}

TEST(limits_themselves_are_accepted) {
    static limits cases[] = {
        {"camera.vertical_fov_degrees", "1", "170"},
        {"camera.path", "{'type':'circle','period':1,'centre':[0,0,0],'axis':[0,1,0]}"},
        {"light.emission", "[0,0,0]"},
        {"light.shadows", "'none'", "'soft'", "'ideal'"},
        {"fog", "0"},
        {"march.max_steps", "1", "7.0"},
        {"march.max_bounces", "0"},
        {"materials.white.reflectivity", "1"},
        {"materials.white.color", "[0,0,0]"},
        {"shapes[0].radius", "1e-9", "1e9"},
        {"shapes[5].offset", "-1e9"},
        {"shapes[6].iterations", "1"},
        {"shapes[6].bailout", "4", "10000"},
        {"shapes[7].scale", "1e-9", "-1"},
        {"shapes[7].iterations", "21"},
        {"shapes[7].minimum_radius", "0.3125", "2"},
        {"shapes[0].path.period", "1e-9"},
        {"shapes[1].path.to", "[0,1e-300,0]", "[1e9,-1e9,1e9]"},
        {"shapes[0].rotation_degrees", "[0,0,0]"},
        {"shapes[0].repeat", "[0,0,0]"},
        {"shapes[1].rounding", "0", "1e-9", "1e9"},
    };
    static const char *const left_out[] = {
        "camera.path",      "shapes[0].position", "shapes[0].rotation_degrees",
        "shapes[0].repeat", "shapes[0].path",     "shapes[1].rounding"};
    for (size_t i = 0; i < LENGTH(cases); i++)
        for (size_t k = 1; cases[i][k]; k++)
            must_be_accepted(cases[i][0], cases[i][k]);
    for (size_t i = 0; i < LENGTH(left_out); i++)
        must_be_accepted(left_out[i], NULL);
}

TEST(counts_of_shapes) {
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
            assert_non_null(strstr(error, ": $.shapes: "));
        }
    }
}

RUN_TESTS(make_file, remove_file)
