// The program: its options, what main.c calls, and how both tell errors (error.c).
#pragma once

#include "driver/errors.h" // the exit statuses

#include <stdbool.h>

struct show;

struct viewer_options {
    const char *scene, *phase, *reference, *script, *out;
    int width, height, threads;
    bool headless;
};

// Prints "viewer: " and the message as one line on standard error, and returns `status`.
int viewer_error(int status, const char *format, ...) __attribute__((format(printf, 2, 3)));

// Renders each frame of a script to OUT/NNNNN.png. Returns an exit status.
int headless_run(const struct viewer_options *options, struct show *show);
// Opens the window and runs until it is closed. `script_path` may be NULL. Returns an exit status.
int window_run(const struct viewer_options *options, struct show *show);
