// One phase as a WebAssembly module: a scene is read, prepared and drawn. The page's camera and resolution are those of
// the window (common/viewer). A module has one scene at a time.
#include <emscripten.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "driver/variant.h"
#include "phase.h"
#include "phase_info.h"
#include "viewer/window/pace.h"
#include "viewer/world.h"

static struct {
    char *text; // of the scene file
    size_t length;
    struct world world;
    struct camera camera;
    struct model moving; // the scene's, at the time of the frame
    struct prepared *prepared;
    struct view view; // of the frame, from the page
    struct frame frame;
    size_t room; // pixels
    struct presenter *presenter;
    uint8_t *rgb8, *rgba;
    struct pace pace;
    double evaluations; // mean of the frame
    char error[SCENE_ERROR_SIZE];
} module;

// The widest words that SIMDe makes of 128 bits without waste.
struct variant variant_here(void) {
    return (struct variant){PHASE_LANES > 1 ? 8 : 1, "WebAssembly SIMD", PHASE_FLAGS};
}

// The scene file is in memory: the module has no files. scene.c is compiled with fopen=web_open.
FILE *web_open(const char *path, const char *mode) {
    (void)path;
    return fmemopen(module.text, module.length, mode);
}

#if __has_include("kernel/kernel.h")
#include "kernel/kernel.h"

// There is no compiler in a browser.
void kernel_load(const struct prepared *prepared, int lanes, const char *flags,
                 struct loaded_kernel *loaded) {
    (void)prepared;
    (void)lanes;
    (void)flags;
    *loaded = (struct loaded_kernel){.facts.reason = "a browser has no compiler"};
}

void kernel_unload(struct loaded_kernel *loaded) {
    *loaded = (struct loaded_kernel){0};
}
#endif

static const char *failed(const char *message) {
    snprintf(module.error, sizeof module.error, "%s", message);
    return module.error;
}

// Returns room for a scene file of `length` bytes, which web_load will read; NULL: memory is short.
EMSCRIPTEN_KEEPALIVE char *web_room(size_t length) {
    free(module.text);
    module.length = length;
    return module.text = malloc(length + 1);
}

// Reads the scene in the room. Returns NULL, or the reader's message; the scene before it is kept then. The camera is
// the file's, unless the scene before it had the same: an edited scene is looked at from the same place.
EMSCRIPTEN_KEEPALIVE const char *web_load(void) {
    struct scene scene;
    if (!scene_load("scene.json", NULL, &scene, module.error))
        return module.error;
    if (module.prepared)
        phase_release(module.prepared);
    module.prepared = NULL;
    free(module.moving.shapes);
    scene_free(&module.world.scene);
    scene.model.animated = scene.model.features.motion;
    struct camera camera = {.flies = scene.flight.path.type != PATH_NONE};
    for (int i = 0; i < 3; i++) {
        camera.position[i] = scene.view.position[i];
        camera.look_at[i] = scene.flight.look_at[i];
        camera.up[i] = scene.flight.up[i];
        camera.light[i] = scene.view.light_position[i];
    }
    if (memcmp(&camera, &module.world.camera, sizeof camera) != 0)
        module.camera = camera;
    module.world.camera = camera;
    module.world.scene = scene;
    return model_copy(&scene.model, &module.moving) ? NULL : failed("out of memory");
}

// Prepares the scene for this phase. Returns NULL, or why the phase does not draw it.
EMSCRIPTEN_KEEPALIVE const char *web_prepare(void) {
    const struct scene *scene = &module.world.scene;
    const char *no = groups_unsupported(PHASE_GROUPS, scene);
    if (!no && phase_unsupported)
        no = phase_unsupported(scene);
    if (no)
        return failed(no);
    if (!module.presenter)
        module.presenter = presenter_create(1);
    module.prepared = phase_prepare(&scene->model, 1);
    return module.prepared && module.presenter ? NULL : failed("out of memory");
}

// Whether something moves by itself: 1 shapes, 2 the camera.
EMSCRIPTEN_KEEPALIVE int web_moves(void) {
    return module.world.scene.model.features.motion + 2 * (int)module.camera.flies;
}

// --- The camera. Returns the view that it has `seconds` after the start, the doubles of struct view.
EMSCRIPTEN_KEEPALIVE const struct view *web_look(double seconds) {
    module.camera.seconds = seconds;
    camera_fly(&module.world, &module.camera);
    module.view = camera_view(&module.world, &module.camera);
    return &module.view;
}

EMSCRIPTEN_KEEPALIVE void web_home(void) {
    module.camera = module.world.camera;
}

EMSCRIPTEN_KEEPALIVE void web_turn(double right, double upward) {
    camera_turn(&module.camera, right, upward);
}

EMSCRIPTEN_KEEPALIVE void web_move(double right, double up, double forward) {
    camera_move(&module.camera, &module.view, (const double[]){right, up, forward});
}

EMSCRIPTEN_KEEPALIVE void web_move_light(double right, double up, double away) {
    camera_move_light(&module.camera, &module.view, (const double[]){right, up, away});
}

// --- A frame: web_frame, then web_draw, which is the timed region, then web_picture.

// Planes in the order of web_plane.
static float **plane_at(int index) {
    struct frame *f = &module.frame;
    float **const planes[] = {&f->rgb, &f->depth, &f->id, &f->normal, &f->evals};
    return index < (int)(sizeof planes / sizeof *planes) ? planes[index] : NULL;
}

static bool make_room(size_t pixels) {
    if (pixels <= module.room)
        return true;
    module.room = 0;
    bool made = true;
    for (int i = 0; plane_at(i); i++) {
        free(*plane_at(i));
        *plane_at(i) = aligned_alloc(64, 3 * sizeof(float) * ((pixels + 63) / 64 * 64));
        made = made && *plane_at(i);
    }
    free(module.rgb8);
    free(module.rgba);
    module.rgb8 = malloc(3 * pixels);
    module.rgba = malloc(4 * pixels);
    module.room = made && module.rgb8 && module.rgba ? pixels : 0;
    return module.room > 0;
}

// Makes a frame, and moves the shapes to `seconds`. Returns where the page writes the view; NULL: memory is short.
EMSCRIPTEN_KEEPALIVE struct view *web_frame(int width, int height, double seconds) {
    if (!make_room((size_t)width * (size_t)height))
        return NULL;
    module.frame.width = width;
    module.frame.height = height;
    if (module.world.scene.model.animated)
        model_move(&module.world.scene.model, seconds, &module.moving);
    return &module.view;
}

// Draws the frame; `all`: with the planes beside its colours. Returns whether memory sufficed.
EMSCRIPTEN_KEEPALIVE bool web_draw(bool all) {
    struct frame frame = module.frame;
    if (!all)
        frame.depth = frame.id = frame.normal = frame.evals = NULL;
    return (!module.world.scene.model.animated || phase_update(module.prepared, &module.moving)) &&
           phase_render(module.prepared, &module.view, &frame);
}

// Black over red and yellow to white. t: 0 to 1.
static void heat(double t, uint8_t rgb[3]) {
    for (int c = 0; c < 3; c++)
        rgb[c] = (uint8_t)(255 * fmax(0, fmin(1, 3 * t - c)));
}

// Returns the picture as a canvas has it, 4 bytes a pixel: colours, or evaluations, white from `most` on.
EMSCRIPTEN_KEEPALIVE const uint8_t *web_picture(double most) {
    size_t pixels = (size_t)module.frame.width * (size_t)module.frame.height;
    double sum = 0;
    frame_present(module.presenter, &module.frame, module.rgb8);
    for (size_t i = 0; i < pixels; i++) {
        if (most > 0) {
            sum += module.frame.evals[i];
            heat(log1p(module.frame.evals[i]) / log1p(most), module.rgb8 + 3 * i);
        }
        memcpy(module.rgba + 4 * i, module.rgb8 + 3 * i, 3);
        module.rgba[4 * i + 3] = 255;
    }
    module.evaluations = sum / (double)pixels;
    return module.rgba;
}

// Returns the mean of the evaluations of the frame's camera rays.
EMSCRIPTEN_KEEPALIVE double web_evaluations(void) {
    return module.evaluations;
}

// Returns a plane of the frame, for tests: 0 linear RGB, 1 depth, 2 shape, 3 normal, 4 evaluations.
EMSCRIPTEN_KEEPALIVE const float *web_plane(int index) {
    return *plane_at(index);
}

// --- The resolution. Starts anew below `most` rows.
EMSCRIPTEN_KEEPALIVE int web_pace_start(int most) {
    pace_start(&module.pace, most);
    return module.pace.height;
}

// Learns from a frame and returns the next one's height. `other_ms`: what showing it took.
EMSCRIPTEN_KEEPALIVE int web_pace(double render_ms, double other_ms, bool still, bool adaptive) {
    module.pace.adaptive = adaptive;
    pace_frame(&module.pace, render_ms, other_ms, still);
    return module.pace.height;
}
