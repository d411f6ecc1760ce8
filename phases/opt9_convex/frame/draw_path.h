// STEPWISE_PATH=list|bvh|march forces one way of drawing, for debugging and tests: closed forms by candidate
// lists, by a BVH however few the shapes, or sphere tracing (fallback/). Unset or empty: the scene decides.
#pragma once

#include "core/prepared.h"

// Returns the path that STEPWISE_PATH names, PATH_DEFAULT if it names none.
enum draw_path draw_path_forced(void);

// Returns NULL if the forced path draws the scene from its camera, else the reason in one sentence. A
// later frame in which a moved shape comes to the camera is marched without a word.
const char *draw_path_unsupported(const struct scene *scene);

// Returns the setting as text for the record, NULL if no path is forced.
const char *draw_path_setting(enum draw_path path);
