// What is shown: two phases of one scene, a mode, a canvas. The window and --headless share it.
#pragma once

#include "viewer/picture/picture.h"
#include "viewer/stage.h"

struct show {
    const struct world *world;
    struct camera camera;
    struct stage left, right; // the phase, and the reference; `right` is open only while needed
    const struct viewer_phase *reference;
    int threads;
    enum mode mode;
    bool split;     // two phases side by side
    double divider; // 0 to 1 of the width
    double amplify; // of differences
    int height;     // of the rendered pictures; their width has the canvas's aspect
    struct canvas canvas;
    struct presenter *presenter;
    uint8_t *left8, *right8, *difference8; // the painted pictures
};

// Makes the canvas. Returns false if memory is short.
bool show_create(struct show *show, int width, int height, int threads);
// Another size of the canvas, with the pictures' height as large. Returns false if memory is short.
bool show_resize(struct show *show, int width, int height);
void show_free(struct show *show);

// Opens a phase for a world. If the phase refuses it, the show stays as it was and `error`
// (SCENE_ERROR_SIZE bytes) has the reason. Another world brings its own camera.
bool show_open(struct show *show, const struct viewer_phase *phase, const struct world *world,
               char *error);
// Takes another reference, unless it refuses the scene.
bool show_reference(struct show *show, const struct viewer_phase *reference, char *error);

// Returns the width of the rendered pictures.
int show_width(const struct show *show);
// Returns whether the reference's picture is needed.
bool show_compares(const struct show *show);

// Renders, paints and composes one frame on the canvas.
bool show_draw(struct show *show, char *error);
// Composes the frame that was drawn last again, for another divider or amplification.
void show_compose(struct show *show);
// Returns the time of the last frame's rendering in nanoseconds: of both phases, if both were drawn.
uint64_t show_ns(const struct show *show);
