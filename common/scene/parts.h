// The parts of reading a scene that have a file of their own.
#ifndef STEPWISE_SCENE_PARTS_H
#define STEPWISE_SCENE_PARTS_H

#include "scene/reader.h"
#include "scene/scene.h"

// shapes.c
void scene_read_shapes(struct reader *r, json_t *root, struct model *model);

// path.c: how a shape moves, from its position on, which has been read.
void scene_read_path(struct reader *r, json_t *shape_object, struct shape *shape);

// hash.c: of what a checked scene says and the limits in use; false: out of memory.
bool scene_hash(json_t *root, const struct limits *march, char hash[17]);

#endif
