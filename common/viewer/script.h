// Camera paths: files of one JSON object a line, recorded by the window or written by hand.
#pragma once

#include <jansson.h>
#include <stdio.h>

#include "viewer/world.h"

struct show;

// A script that is being played. docs/view.md describes its lines.
struct script {
    const char *path;
    json_t *lines;   // an array of objects
    size_t line;     // the next one
    int step, steps; // frames of the current line: those begun, and all
    struct camera from, to;
};

// Reads and checks a script. Returns false with one line in `error`.
bool script_read(struct script *script, const char *path, char *error);
// Sets `show` to the script's next frame. Returns 1, 0 after the last frame, -1 with one line in
// `error` if the line asks for a phase or scene that cannot be had.
int script_next(struct script *script, struct show *show, char *error);
void script_free(struct script *script);

// Appends a line with what is shown now. Returns false if it cannot be written.
bool script_record(FILE *file, const struct show *show);
