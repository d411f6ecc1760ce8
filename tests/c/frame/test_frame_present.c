// Presenting a frame, gamma and 8 bits: compared with the formula for every float. Every instruction set gives the same
// bytes.
#include "tests/c/testing.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "frame/frame.h"
#include "random_float.h"

static int formula(float c) {
    return c > 0 ? (int)(255 * fmin(1, pow((double)c, 0.4545))) : 0;
}

static float from_bits(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

enum { BATCH = 3 << 16, ONE = 0x3f800000, NEIGHBOURS = 64 };

struct shower {
    struct presenter *presenter;
    struct frame frame;
    uint8_t *shown;
};

static const uint8_t *show(struct shower *s) {
    frame_present(s->presenter, &s->frame, s->shown);
    return s->shown;
}

static struct shower shower_create(void) {
    struct shower s = {.presenter = presenter_create(2), .shown = malloc(BATCH)};
    assert_true(s.presenter && s.shown && frame_create(&s.frame, BATCH / 3, 1, false, NULL));
    return s;
}

static void shower_free(struct shower *s) {
    presenter_free(s->presenter);
    frame_free(&s->frame);
    free(s->shown);
}

// All 1,065,353,216 floats of [0, 1). The byte never falls as the float grows. It changes only
// where the formula does, which is compared on NEIGHBOURS floats either side of each change. Between
// two changes the formula is constant too: one float's step moves 255·c^0.4545 by a relative 2.7e-8,
// and pow errs by 1e-16.
TEST(present_is_the_formula_for_every_float) {
    struct shower s = shower_create();
    int last = 0, changes = 0;
    uint32_t change[256] = {0};
    for (uint32_t first = 0; first < ONE; first += BATCH) {
        uint32_t count = ONE - first < BATCH ? ONE - first : BATCH;
        for (uint32_t i = 0; i < BATCH; i++)
            s.frame.rgb[i] = from_bits(i < count ? first + i : ONE);
        const uint8_t *shown = show(&s);
        // Most batches show as a single byte value. memcmp with the batch shifted by one is faster than a loop.
        if (shown[0] == last && memcmp(shown, shown + 1, count - 1) == 0)
            continue;
        for (uint32_t i = 0; i < count; i++) {
            if (shown[i] == last)
                continue;
            assert_int_equal(shown[i], last + 1); // up, by one, 254 times
            last = shown[i];
            change[++changes] = first + i;
        }
    }
    assert_int_equal(changes, 254); // 255 is 1.0 and more
    for (int k = 1; k <= 255; k++) {
        uint32_t first = (k == 255 ? ONE : change[k]) - NEIGHBOURS;
        for (uint32_t i = 0; i < BATCH; i++)
            s.frame.rgb[i] = from_bits(first + i % (2 * NEIGHBOURS));
        const uint8_t *shown = show(&s);
        for (uint32_t i = 0; i < 2 * NEIGHBOURS; i++)
            if (shown[i] != formula(from_bits(first + i)))
                fail_msg("%a shows as %d, the formula says %d", (double)from_bits(first + i),
                         shown[i], formula(from_bits(first + i)));
    }
    shower_free(&s);
}

// Each instruction set gives the formula's bytes: around every change, on random floats, and for any number of pixels.
// Not a byte is written beyond the last.
TEST(every_width_shows_the_same_bytes) {
    static const char *const limits[] = {"none", "avx2", NULL};
    uint64_t seed = 11;
    struct shower s = shower_create();
    static uint8_t expected[BATCH];
    for (int i = 0; i < BATCH; i++) { // a float beside a change, or any float
        double change = pow((i / 8 % 255 + 1) / 255.0, 1 / 0.4545);
        uint32_t bits;
        float near = (float)change;
        memcpy(&bits, &near, sizeof bits);
        s.frame.rgb[i] = i % 2 ? random_float(&seed) : from_bits(bits + (uint32_t)(i / 2 % 4) - 2);
        static const float special[] = {NAN,   -NAN,   INFINITY, -INFINITY,
                                        -0.0f, 1e-45f, 1,        1.0000001f};
        if (i % 13 == 0)
            s.frame.rgb[i] = special[i / 13 % LENGTH(special)];
        expected[i] = (uint8_t)formula(s.frame.rgb[i]);
    }
    for (size_t k = 0; k < LENGTH(limits); k++) {
        limits[k] ? setenv("STEPWISE_ISA_LIMIT", limits[k], 1) : unsetenv("STEPWISE_ISA_LIMIT");
        struct presenter *presenter = presenter_create(
            3); // three threads share the whole frame; a small part is too small to share
        assert_non_null(presenter);
        struct frame part = s.frame;
        for (int pixels = 1; pixels <= 40; pixels++) {
            part.rgb = s.frame.rgb + 3 * pixels;
            part.width = pixels;
            memset(s.shown, 77, BATCH);
            frame_present(presenter, &part, s.shown);
            assert_memory_equal(s.shown, expected + 3 * pixels, 3 * (size_t)pixels);
            for (int i = 3 * pixels; i < 3 * pixels + 64; i++)
                assert_int_equal(s.shown[i], 77);
            memset(s.shown, 77, BATCH); // presenter_show() takes any number of samples
            presenter_show(presenter, part.rgb, (size_t)pixels, s.shown);
            assert_memory_equal(s.shown, expected + 3 * pixels, (size_t)pixels);
            for (int i = pixels; i < pixels + 64; i++)
                assert_int_equal(s.shown[i], 77);
        }
        presenter_show(presenter, s.frame.rgb, BATCH, s.shown);
        assert_memory_equal(s.shown, expected, BATCH);
        frame_present(presenter, &s.frame, s.shown);
        assert_memory_equal(s.shown, expected, BATCH);
        presenter_free(presenter);
    }
    shower_free(&s);
}

RUN_TESTS(NULL, NULL)
