// The frame's planes, EXR written and read back bit for bit, and what happens when a disk refuses.
#include "tests/c/testing.h"

#include <dirent.h>
#include <math.h>
#include <openexr.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "frame/frame.h"
#include "random_float.h"

static char folder[] = "/tmp/stepwise-frame-XXXXXX";
static char file_name[sizeof folder + 16];
static char error[512];

static int make_folder(void **state) {
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    snprintf(file_name, sizeof file_name, "%s/a.exr", folder);
    return 0;
}

static int remove_folder(void **state) {
    (void)state;
    unlink(file_name);
    return rmdir(folder);
}

// Returns how many files the folder holds. A temporary file that is left behind shows here.
static int files_in(const char *path) {
    DIR *directory = opendir(path);
    assert_non_null(directory);
    int count = 0;
    for (struct dirent *entry; (entry = readdir(directory)) != NULL;)
        count += entry->d_name[0] != '.';
    closedir(directory);
    return count;
}

static struct frame random_frame(int width, int height, bool aov) {
    struct frame frame;
    assert_true(frame_create(&frame, width, height, aov, NULL));
    uint64_t seed = 1;
    float *planes[] = {frame.rgb, frame.normal, frame.depth, frame.id, frame.evals};
    for (int p = 0; p < 5; p++)
        for (int i = 0; planes[p] && i < width * height * (p < 2 ? 3 : 1); i++)
            planes[p][i] = random_float(&seed);
    if (aov)
        frame.depth[0] = INFINITY; // a miss
    frame.rgb[0] = -0.0f;
    return frame;
}

TEST(planes_are_preset) {
    for (int aov = 0; aov < 2; aov++) {
        struct frame frame;
        assert_true(frame_create(&frame, 17, 5, aov, NULL));
        assert_int_equal(frame.width, 17);
        assert_int_equal(frame.height, 5);
        float *planes[] = {frame.rgb, frame.normal, frame.depth, frame.id, frame.evals};
        for (int p = 0; p < 5; p++) {
            assert_int_equal(planes[p] != NULL, p == 0 || aov);
            assert_int_equal((uintptr_t)planes[p] % 64, 0);
            for (int i = 0; planes[p] && i < 17 * 5 * (p < 2 ? 3 : 1); i++)
                assert_true(isnan(planes[p][i]));
        }
        frame_free(&frame);
        assert_null(frame.rgb);
    }
}

#define EXR(call) assert_int_equal(call, EXR_ERR_SUCCESS)

// Reads one channel of the file by OpenEXR itself. Returns false if the file has no such channel.
static bool read_channel(const char *name, int width, int height, float *out) {
    exr_context_t file;
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    EXR(exr_start_read(&file, file_name, &setup));
    exr_attr_box2i_t window;
    EXR(exr_get_data_window(file, 0, &window));
    assert_int_equal(window.max.x - window.min.x + 1, width);
    assert_int_equal(window.max.y - window.min.y + 1, height);
    int32_t lines;
    EXR(exr_get_scanlines_per_chunk(file, 0, &lines));
    exr_decode_pipeline_t decoder = EXR_DECODE_PIPELINE_INITIALIZER;
    bool found = false;
    for (int y = 0; y < height; y += lines) {
        exr_chunk_info_t chunk;
        EXR(exr_read_scanline_chunk_info(file, 0, y, &chunk));
        EXR(y == 0 ? exr_decoding_initialize(file, 0, &chunk, &decoder)
                   : exr_decoding_update(file, 0, &chunk, &decoder));
        for (int c = 0; c < decoder.channel_count; c++) {
            exr_coding_channel_info_t *channel = &decoder.channels[c];
            bool wanted = strcmp(channel->channel_name, name) == 0;
            found = found || wanted;
            assert_int_equal(channel->data_type, EXR_PIXEL_FLOAT);
            channel->decode_to_ptr = wanted ? (uint8_t *)(out + (size_t)y * (size_t)width) : NULL;
            channel->user_data_type = EXR_PIXEL_FLOAT;
            channel->user_bytes_per_element = sizeof *out;
            channel->user_pixel_stride = sizeof *out;
            channel->user_line_stride = width * (int)sizeof *out;
        }
        if (y == 0)
            EXR(exr_decoding_choose_default_routines(file, 0, &decoder));
        EXR(exr_decoding_run(file, 0, &decoder));
    }
    EXR(exr_decoding_destroy(file, &decoder));
    EXR(exr_finish(&file));
    return found;
}

static void same_in_the_file(const struct frame *frame) {
    int width = frame->width, height = frame->height, pixels = width * height;
    bool aov = frame->depth != NULL;
    if (!frame_write_exr(frame, file_name, error))
        fail_msg("%s", error);
    assert_int_equal(files_in(folder), 1);
    const struct {
        const char *name;
        const float *samples;
        int stride;
    } channels[] = {{"R", frame->rgb, 3},
                    {"G", frame->rgb + 1, 3},
                    {"B", frame->rgb + 2, 3},
                    {"Z", frame->depth, 1},
                    {"id", frame->id, 1},
                    {"evals", frame->evals, 1},
                    {"N.x", frame->normal, 3},
                    {"N.y", aov ? frame->normal + 1 : NULL, 3},
                    {"N.z", aov ? frame->normal + 2 : NULL, 3}};
    float *back = calloc((size_t)pixels, sizeof *back);
    assert_non_null(back);
    for (int c = 0; c < 9; c++) {
        assert_int_equal(read_channel(channels[c].name, width, height, back), c < 3 || aov);
        for (int k = 0; channels[c].samples && k < pixels; k++)
            if (memcmp(&back[k], &channels[c].samples[k * channels[c].stride], sizeof *back) != 0)
                fail_msg("%dx%d, channel %s, pixel %d: %a came back as %a", width, height,
                         channels[c].name, k, (double)channels[c].samples[k * channels[c].stride],
                         (double)back[k]);
    }
    free(back);
}

TEST(exr_keeps_every_bit) {
    static const int sizes[][2] = {{1, 1}, {17, 5}, {3, 16}, {5, 17}, {64, 40}};
    for (int i = 0; i < 10; i++) {
        struct frame frame = random_frame(sizes[i / 2][0], sizes[i / 2][1], i % 2);
        same_in_the_file(&frame);
        frame_free(&frame);
    }
}

// Pictures of 72 bytes, with more and more of their bits zero. Some do not get shorter when they are compressed.
TEST(exr_keeps_what_hardly_compresses) {
    for (int round = 0; round < 18 * 24; round++) {
        struct frame frame = random_frame(2, 1, true);
        float *planes[] = {frame.rgb, frame.normal, frame.depth, frame.id, frame.evals};
        for (int p = 0, at = 0; p < 5; p++)
            for (int i = 0; i < (p < 2 ? 6 : 2); i++, at++) {
                uint32_t bits;
                memcpy(&bits, &planes[p][i], sizeof bits);
                bits &= at < round / 24 ? 0 : UINT32_MAX << round % 24;
                memcpy(&planes[p][i], &bits, sizeof bits);
            }
        same_in_the_file(&frame);
        frame_free(&frame);
    }
}

// Clamped before, so that a highlight is as bright as it is seen; what is not finite is not averaged away.
TEST(an_average_is_of_clamped_samples) {
    struct frame large, frame;
    assert_true(frame_create(&large, 4, 2, false, NULL) && frame_create(&frame, 2, 1, false, NULL));
    for (int i = 0; i < 24; i++)
        large.rgb[i] = 0.25f;
    large.rgb[0] = 3;      // red of the first block
    large.rgb[3] = -1;     // and of the pixel beside it
    large.rgb[13] = 0.75f; // its green, in the lower row
    large.rgb[8] = INFINITY;
    frame_average(&large, 2, &frame);
    static const float expected[6] = {0.375f, 0.375f, 0.25f, 0.25f, 0.25f, NAN};
    for (int i = 0; i < 6; i++)
        assert_true(isnan(expected[i]) ? isnan(frame.rgb[i]) : frame.rgb[i] == expected[i]);
    frame_free(&large);
    frame_free(&frame);
}

static void refused(const char *path, const char *reason) {
    struct frame frame = random_frame(2, 2, false);
    error[0] = '\0';
    assert_false(frame_writable(path, error));
    assert_true(strstr(error, path) && strstr(error, reason));
    error[0] = '\0';
    assert_false(frame_write_exr(&frame, path, error));
    assert_non_null(strstr(error, path));
    frame_free(&frame);
}

TEST(unwritable_places_are_refused) {
    refused("/nowhere/a.exr", "No such file");
    refused("/proc/a.exr", "No such file");
    refused("/dev/null/a.exr", "Not a directory");
    refused(folder, "regular file");
    char *path = malloc(6000);
    assert_non_null(path);
    memset(path, 'x', 5999);
    path[5999] = '\0';
    assert_false(frame_writable(path, error));
    assert_non_null(strstr(error, "4,000"));
    free(path);
    // frame_writable() leaves no file behind and does not change an earlier picture.
    struct frame frame = random_frame(3, 2, true);
    assert_true(frame_write_exr(&frame, file_name, error));
    assert_true(frame_writable(file_name, error));
    assert_int_equal(files_in(folder), 1);
    float back[6];
    assert_true(read_channel("R", 3, 2, back) && back[1] == frame.rgb[3]);
    frame_free(&frame);
}

static void write_that_must_fail(const char *path) {
    struct frame frame = random_frame(200, 200, true); // does not compress: about 1.4 MB
    bool written = frame_write_exr(&frame, path, error);
    assert_non_null(strstr(error, ": cannot be written: "));
    error[0] = '\0';
    written =
        frame_write_ppm(200, 200, (const uint8_t *)frame.rgb, path, error) || written; // 120 kB
    assert_non_null(strstr(error, ": cannot be written: "));
    error[0] = '\0';
    written =
        frame_write_png(200, 200, (const uint8_t *)frame.rgb, path, error) || written; // 110 kB
    frame_free(&frame);
    assert_false(written);
    assert_non_null(strstr(error, ": cannot be written: "));
    assert_null(strchr(error, '\n'));
}

// A write that fails half way does not change the old picture. Here it exceeds the limit of a file's size.
TEST(failed_write_keeps_the_old_picture) {
    struct frame small = random_frame(3, 2, false);
    assert_true(frame_write_exr(&small, file_name, error));
    struct rlimit old;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    void (*handler)(int) = signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &(struct rlimit){65536, old.rlim_max}), 0);
    write_that_must_fail(file_name);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    signal(SIGXFSZ, handler);
    assert_int_equal(files_in(folder), 1);
    float back[6];
    assert_true(read_channel("G", 3, 2, back) && back[5] == small.rgb[16]);
    frame_free(&small);
}

RUN_TESTS(make_folder, remove_folder)
