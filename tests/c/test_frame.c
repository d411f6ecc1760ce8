// The frame: its presets, EXR written and read back bit for bit, what happens when a disk refuses,
// and gamma with 8 bits against its formula for every float there is.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <openexr.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "frame/frame.h"

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

// Names in the folder other than `.` and `..`: a temporary file left behind shows here.
static int files_in(const char *path) {
    DIR *directory = opendir(path);
    assert_non_null(directory);
    int count = 0;
    for (struct dirent *entry; (entry = readdir(directory)) != NULL;)
        count += entry->d_name[0] != '.';
    closedir(directory);
    return count;
}

static float random_float(uint64_t *seed) { // any finite bits (Knuth's MMIX LCG)
    float value;
    do {
        *seed = *seed * 6364136223846793005u + 1442695040888963407u;
        uint32_t bits = (uint32_t)(*seed >> 32);
        memcpy(&value, &bits, sizeof value);
    } while (!isfinite(value));
    return value;
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

static void planes_are_preset(void **state) {
    (void)state;
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

// Reads one channel of the file, as its own library sees it; returns false if there is none of it.
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

static void exr_keeps_every_bit(void **state) {
    (void)state;
    static const int sizes[][2] = {{1, 1}, {17, 5}, {3, 16}, {5, 17}, {64, 40}};
    for (int i = 0; i < 10; i++) {
        struct frame frame = random_frame(sizes[i / 2][0], sizes[i / 2][1], i % 2);
        same_in_the_file(&frame);
        frame_free(&frame);
    }
}

// 72 bytes of which more and more are known: some are as long when they are compressed.
static void exr_keeps_what_hardly_compresses(void **state) {
    (void)state;
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

static void refused(const char *path, const char *reason) {
    struct frame frame = random_frame(2, 2, false);
    char expected[512];
    snprintf(expected, sizeof expected, "%s: cannot be written: %s", path, reason);
    error[0] = '\0';
    assert_false(frame_writable(path, error));
    assert_string_equal(error, expected);
    error[0] = '\0';
    assert_false(frame_write_exr(&frame, path, error));
    assert_non_null(strstr(error, ": cannot be written: "));
    frame_free(&frame);
}

static void unwritable_places_are_refused(void **state) {
    (void)state;
    refused("/nowhere/a.exr", "No such file or directory");
    refused("/proc/a.exr", "No such file or directory");
    refused("/dev/null/a.exr", "Not a directory");
    refused(folder, "it exists and is no regular file");
    char *path = malloc(6000);
    assert_non_null(path);
    memset(path, 'x', 5999);
    path[5999] = '\0';
    assert_false(frame_writable(path, error));
    assert_string_equal(error, "the output's path is longer than 4,000 characters");
    free(path);
    // Asking leaves nothing behind, and nothing of an earlier picture is touched.
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
    frame_free(&frame);
    assert_false(written);
    assert_non_null(strstr(error, ": cannot be written: "));
    assert_null(strchr(error, '\n'));
}

// A write that fails half way (here: over the limit of a file's size) leaves the old picture alone.
static void failed_write_keeps_the_old_picture(void **state) {
    (void)state;
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

static bool write_text(const char *path, const char *text) {
    int file = open(path, O_WRONLY);
    bool written = file >= 0 && write(file, text, strlen(text)) == (ssize_t)strlen(text);
    if (file >= 0)
        close(file);
    return written;
}

// A file system of 64 KiB over the folder, seen by this process alone and gone with it.
static bool small_disk(void) {
    char map[32];
    snprintf(map, sizeof map, "0 %d 1", (int)getuid());
    if (unshare(CLONE_NEWNS) != 0 &&
        (unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0 || !write_text("/proc/self/uid_map", map)))
        return false;
    return mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) == 0 &&
           mount("tmpfs", folder, "tmpfs", 0, "size=64k") == 0;
}

enum { FULL_AS_EXPECTED = 0, NOT_AS_EXPECTED = 1, NO_NAMESPACES = 77 };

static void full_disk(void **state) {
    (void)state;
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        if (!small_disk())
            _exit(NO_NAMESPACES);
        struct frame frame = random_frame(200, 200, true);
        bool written = frame_write_exr(&frame, file_name, error);
        bool named = strstr(error, ": cannot be written: No space left on device") != NULL;
        written =
            frame_write_ppm(200, 200, (const uint8_t *)frame.rgb, file_name, error) || written;
        named = named && strstr(error, ": cannot be written: No space left on device") != NULL;
        if (!named)
            print_error("%s\n", error);
        _exit(!written && named && files_in(folder) == 0 ? FULL_AS_EXPECTED : NOT_AS_EXPECTED);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    if (WEXITSTATUS(status) == NO_NAMESPACES) {
        print_message("skipped: this machine lacks mount namespaces for a small tmpfs\n");
        skip();
    }
    assert_int_equal(WEXITSTATUS(status), FULL_AS_EXPECTED);
}

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

// All 1,065,353,216 floats of [0, 1): the byte never falls as the float grows, and it changes only
// where the formula does (compared on NEIGHBOURS floats either side of each change). Between two
// changes the formula is constant too: one float's step moves 255·c^0.4545 by a relative 2.7e-8,
// and pow errs by 1e-16.
static void present_is_the_formula_for_every_float(void **state) {
    (void)state;
    struct shower s = shower_create();
    int last = 0, changes = 0;
    uint32_t change[256] = {0};
    for (uint32_t first = 0; first < ONE; first += BATCH) {
        uint32_t count = ONE - first < BATCH ? ONE - first : BATCH;
        for (uint32_t i = 0; i < BATCH; i++)
            s.frame.rgb[i] = from_bits(i < count ? first + i : ONE);
        const uint8_t *shown = show(&s);
        // A whole batch is one byte or few: memcmp with itself, one on, is quicker than a loop.
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

static void present_outside_the_range(void **state) {
    (void)state;
    static const struct {
        float value;
        uint8_t shown;
    } cases[] = {{NAN, 0},   {-NAN, 0},         {-INFINITY, 0}, {INFINITY, 255},
                 {-0.0f, 0}, {-1e-30f, 0},      {-1, 0},        {1e-45f, 0},
                 {1, 255},   {1.0000001f, 255}, {3.4e38f, 255}, {0.9999999f, 254},
                 {0.5f, 186}};
    enum { CASES = sizeof cases / sizeof *cases };
    struct shower s = shower_create();
    for (int i = 0; i < BATCH; i++)
        s.frame.rgb[i] = cases[i % CASES].value;
    const uint8_t *shown = show(&s);
    for (int i = 0; i < BATCH; i++)
        if (shown[i] != cases[i % CASES].shown)
            fail_msg("%g shows as %d", (double)cases[i % CASES].value, shown[i]);
    shower_free(&s);
}

// Written for a check of the check above: the formula itself on random floats.
static void present_on_samples(void **state) {
    (void)state;
    struct shower s = shower_create();
    uint64_t seed = 7;
    for (int round = 0; round < 5; round++) {
        for (int i = 0; i < BATCH; i++) {
            float value = random_float(&seed);
            s.frame.rgb[i] = round ? fmodf(fabsf(value), 1.25f) : value;
        }
        const uint8_t *shown = show(&s);
        for (int i = 0; i < BATCH; i++)
            assert_int_equal(shown[i], formula(s.frame.rgb[i]));
    }
    shower_free(&s);
}

// By each instruction set: the bytes of the formula around every change, at random, and in a tail of any length
// with not a byte written beyond it.
static void every_width_shows_the_same_bytes(void **state) {
    (void)state;
    static const char *const limits[] = {"none", "avx2", NULL};
    uint64_t seed = 11;
    struct shower s = shower_create();
    static uint8_t expected[BATCH];
    for (int i = 0; i < BATCH; i++) { // a float beside a change, or any
        double change = pow((i / 8 % 255 + 1) / 255.0, 1 / 0.4545);
        uint32_t bits;
        float near = (float)change;
        memcpy(&bits, &near, sizeof bits);
        s.frame.rgb[i] = i % 2 ? random_float(&seed) : from_bits(bits + (uint32_t)(i / 2 % 4) - 2);
        static const float not_finite[] = {NAN, -NAN, INFINITY, -INFINITY};
        if (i % 13 == 0)
            s.frame.rgb[i] = not_finite[i / 13 % 4];
        expected[i] = (uint8_t)formula(s.frame.rgb[i]);
    }
    for (size_t k = 0; k < sizeof limits / sizeof *limits; k++) {
        limits[k] ? setenv("STEPWISE_ISA_LIMIT", limits[k], 1) : unsetenv("STEPWISE_ISA_LIMIT");
        struct presenter *presenter = presenter_create(3); // threads: of the whole, not of a part
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
            memset(s.shown, 77, BATCH); // and of samples of any number, as a phase shows its own
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

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planes_are_preset),
        cmocka_unit_test(exr_keeps_every_bit),
        cmocka_unit_test(exr_keeps_what_hardly_compresses),
        cmocka_unit_test(unwritable_places_are_refused),
        cmocka_unit_test(failed_write_keeps_the_old_picture),
        cmocka_unit_test(full_disk),
        cmocka_unit_test(present_is_the_formula_for_every_float),
        cmocka_unit_test(present_outside_the_range),
        cmocka_unit_test(present_on_samples),
        cmocka_unit_test(every_width_shows_the_same_bytes),
    };
    return cmocka_run_group_tests_name("frame", tests, make_folder, remove_folder);
}
