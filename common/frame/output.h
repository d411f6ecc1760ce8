// Files that are there whole or not at all: written under a temporary name, then renamed, which is atomic.
#pragma once

#include <signal.h>
#include <stdbool.h>

enum { OUTPUT_ERROR = 512, OUTPUT_SIGNALS = 3 };

// A file being written. A signal that ends the program removes `temporary` first, except for SIGKILL.
struct output {
    const char *path;
    char temporary[4096];
    struct sigaction before[OUTPUT_SIGNALS];
};

// Sets the temporary name. Returns false with one line in `error` (OUTPUT_ERROR bytes) if it is too long.
bool output_begin(struct output *output, const char *path, char *error);
// Renames the file if all of it was `written`, else removes it. Returns whether the file is complete; if not, `error`
// gets a line with the `reason`.
bool output_end(struct output *output, bool written, const char *reason, char *error);
