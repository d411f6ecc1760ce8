// STEPWISE_PATH=list|bvh|march forces one way of drawing, for debugging and for tests that compare
// the ways. `list`: closed forms and candidate lists over all shapes. `bvh`: the same from a BVH,
// however few the shapes are. `march`: sphere tracing (fallback/). Unset or empty: the scene decides.
#pragma once

#include "types/primitive.h"

// Returns the path that STEPWISE_PATH names, PATH_DEFAULT if it names none.
enum draw_path draw_path_forced(void);

// Returns NULL if the forced path draws the scene from its camera, else the reason in one sentence.
// `sixteen`: lanes, not eight. One replacement stays without a word: a frame of an animation in which
// a moved shape comes to the camera is marched.
const char *draw_path_unsupported(const struct scene *scene, bool sixteen);

// Returns the setting as text for the record, NULL if no path is forced.
const char *draw_path_setting(enum draw_path path);
