// The camera's frame: three unit vectors, made of the camera's position, the point it looks at and its `up` vector.
#include "near.h"
#include "scene_file.h"
#include "tests/c/phases/random_from.h"

// The frame is orthonormal. `forward` points to look_at, and right = normalize(up × forward): x grows to the right.
TEST(camera_frames) {
    for (int i = 0; i < 200; i++) {
        double p[3], q[3], up[3], length = pow(10, 4 * random_from(-1, 1)), c[3];
        for (int k = 0; k < 3; k++) {
            p[k] = 10 * random_from(-1, 1);
            q[k] = p[k] + length * random_from(-1, 1);
            up[k] = random_from(-1, 1);
        }
        json_t *root = parse(WHOLE);
        json_t *camera = json_pack("{s:[f,f,f], s:[f,f,f], s:[f,f,f], s:f}", "position", p[0], p[1],
                                   p[2], "look_at", q[0], q[1], q[2], "up", up[0], up[1], up[2],
                                   "vertical_fov_degrees", 30.);
        json_object_set_new(root, "camera", camera);
        assert_true(load_json(root, JSON_REAL_PRECISION(17)));
        json_decref(root);
        const struct view *v = &scene.view;
        assert_true(near(dot3(v->right, v->right), 1, 1e-14) && near(dot3(v->up, v->up), 1, 1e-12));
        assert_true(near(dot3(v->forward, v->forward), 1, 1e-14));
        assert_true(near(dot3(v->right, v->up), 0, 1e-12) &&
                    near(dot3(v->right, v->forward), 0, 1e-12));
        cross3(v->forward, v->right,
               c); // the frame is (right, up, forward) with up = forward × right
        for (int k = 0; k < 3; k++)
            assert_true(near(v->up[k], c[k], 1e-15));
        cross3(up, v->forward, c);
        double size = sqrt(dot3(c, c));
        for (int k = 0; k < 3; k++)
            assert_true(near(v->right[k], c[k] / size, 1e-10));
        double d[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
        assert_true(near(dot3(d, v->forward), sqrt(dot3(d, d)), 1e-12 * length));
        scene_free(&scene);
    }
}

// The camera may be very close to look_at. The square of 3e-161 is denormal: a length computed from it would be wrong in
// the third digit.
TEST(a_tiny_step_to_look_at_is_still_a_direction) {
    for (int e = 0; e >= -300; e -= 20) {
        json_t *root = parse(WHOLE);
        json_t *camera = json_pack("{s:[i,i,i], s:[f,i,f], s:[i,i,i], s:f}", "position", 0, 0, 0,
                                   "look_at", 3 * pow(10, e), 0, 4 * pow(10, e), "up", 0, 1, 0,
                                   "vertical_fov_degrees", 30.);
        json_object_set_new(root, "camera", camera);
        assert_true(load_json(root, JSON_REAL_PRECISION(17)));
        json_decref(root);
        const double digits = 1e-15;
        assert_true(near(scene.view.forward[0], 0.6, digits));
        assert_true(near(scene.view.forward[2], 0.8, digits));
        scene_free(&scene);
    }
}

// The camera goes to the line's other end and back. It looks at the same point from everywhere.
TEST(the_camera_follows_its_path) {
    load_whole();
    struct view view;
    for (int period = -1; period < 3; period++) {
        assert_int_equal(scene_view(&scene, 4.0 * period, &view), AIM_OK);
        assert_memory_equal(&view, &scene.view, sizeof view);
    }
    const double to[3] = {3, 0, 5}, look_at[3] = {4, -1, 9}, light[3] = {5, 6, 7};
    assert_int_equal(scene_view(&scene, 2, &view), AIM_OK);
    assert_memory_equal(view.position, to, sizeof to);
    assert_memory_equal(view.light_position, light, sizeof light);
    assert_true(view.tan_half_fov == scene.view.tan_half_fov);
    for (double t = 0; t < 4; t += 0.3) {
        double part = 0.5 - 0.5 * cos(M_PI * t / 2), ahead[3];
        assert_int_equal(scene_view(&scene, t, &view), AIM_OK);
        for (int i = 0; i < 3; i++) {
            double place = (1 - part) * (i + 1) + part * to[i];
            assert_true(near(view.position[i], place, 1e-14));
            ahead[i] = look_at[i] - place;
        }
        assert_true(near(dot3(ahead, view.forward), sqrt(dot3(ahead, ahead)), 1e-13));
        assert_true(near(dot3(view.right, view.forward), 0, 1e-15));
    }
    scene_free(&scene);
    assert_true(accepted("camera.path", NULL));
    assert_int_equal(scene_view(&scene, 1.7, &view), AIM_OK);
    assert_memory_equal(&view, &scene.view, sizeof view);
    scene_free(&scene);
}

// A line through look_at, and one to a place from where the camera looks along `up`.
TEST(a_path_without_a_direction_is_told) {
    struct view view;
    assert_true(accepted("camera.path.to", "[7,-4,15]")); // look_at is halfway
    assert_int_equal(scene_view(&scene, 1, &view), AIM_AT_ITSELF);
    assert_int_equal(scene_view(&scene, 2, &view), AIM_OK);
    scene_free(&scene);
    assert_true(accepted("camera.path.to", "[3.9,-2,8.8]")); // look_at − up
    assert_int_equal(scene_view(&scene, 2, &view), AIM_ALONG_UP);
    assert_int_equal(scene_view(&scene, 1, &view), AIM_OK);
    scene_free(&scene);
}

RUN_TESTS(make_file, remove_file)
