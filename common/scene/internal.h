// Functions that the files of the scene reader share.
#ifndef STEPWISE_SCENE_INTERNAL_H
#define STEPWISE_SCENE_INTERNAL_H

#include "scene/reader.h"
#include "scene/scene.h"

// shapes.c: reads $.shapes into `model`, whose materials are already read. Reports errors to `r`.
void scene_read_shapes(struct reader *r, json_t *root, struct model *model);

// path.c: reads a shape's path. The shape's position must already be read.
void scene_read_path(struct reader *r, json_t *shape_object, struct shape *shape);

// hash.c: writes the hash of a checked scene and of the limits in use as hexadecimal text. Returns
// false if memory is short.
bool scene_hash(json_t *root, const struct limits *march, char hash[17]);

#endif
