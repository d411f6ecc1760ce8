// The program: its options, what main.c calls, and how both tell errors.
#pragma once

#include "driver/errors.h"

#include <stdbool.h>

struct show;

struct viewer_options {
    const char *scene, *phase, *reference, *script, *out;
    int width, height, threads;
    bool headless;
};

#define viewer_error(...) program_error("viewer", __VA_ARGS__)

// Renders each frame of a script to OUT/NNNNN.png. Returns an exit status.
int headless_run(const struct viewer_options *options, struct show *show);
// Opens the window and runs until it is closed. `script_path` may be NULL. Returns an exit status.
int window_run(const struct viewer_options *options, struct show *show);
