// PSNR and the amplified difference of pictures whose answers are known by arithmetic.
#include "tests/c/testing.h"

#include <math.h>

#include "viewer/picture/picture.c"

enum { WIDTH = 4, HEIGHT = 2, SAMPLES = 3 * WIDTH * HEIGHT };

static struct frame filled(float value) {
    struct frame frame;
    assert_true(frame_create(&frame, WIDTH, HEIGHT, false, NULL));
    for (int i = 0; i < SAMPLES; i++)
        frame.rgb[i] = value;
    return frame;
}

TEST(psnr_is_of_clamped_colours) {
    struct frame a = filled(0.5f), b = filled(0.4f);
    assert_true(fabs(picture_psnr(&a, &b) - 20) < 1e-5); // an error of 0.1 everywhere
    for (int i = 0; i < SAMPLES; i++)
        b.rgb[i] = i < SAMPLES / 4 ? 0.4f : 0.5f; // in a quarter of the samples
    assert_true(fabs(picture_psnr(&a, &b) - (20 + 10 * log10(4))) < 1e-5);
    assert_true(isinf(picture_psnr(&a, &a)));
    b.rgb[3] = NAN;
    assert_true(isnan(picture_psnr(&a, &b)));
    frame_free(&a);
    frame_free(&b);
    a = filled(7), b = filled(1); // both are white
    assert_true(isinf(picture_psnr(&a, &b)));
    frame_free(&a);
    frame_free(&b);
}

TEST(differences_are_amplified_and_end_at_255) {
    const uint8_t a[4] = {10, 20, 200, 0}, b[4] = {12, 17, 0, 0};
    uint8_t out[4];
    picture_difference(a, b, 4, 16, out);
    const uint8_t expected[4] = {32, 48, 255, 0};
    assert_memory_equal(out, expected, 4);
}

RUN_TESTS(NULL, NULL)
