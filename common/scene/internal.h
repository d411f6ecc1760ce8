// Functions that the files of the scene reader share.
#pragma once

#include "scene/reader.h"
#include "scene/scene.h"

// groups.c: reads $.shapes into `model`, whose materials are already read. Reports errors to `r`.
void scene_read_shapes(struct reader *r, json_t *root, struct model *model);

// shapes.c: reads one shape: type, transform and, but for a group, sizes and material. Modifiers, operation and
// members are left to groups.c.
void scene_read_shape(struct reader *r, json_t *object, json_t *materials, struct shape *shape);

// path.c: reads the path of a shape or of the camera, whose position is already read.
void scene_read_path(struct reader *r, json_t *owner, const double position[3], struct path *path);

// path.c: writes where the path leads from `still` at `seconds`.
void path_follow(const struct path *path, const double still[3], double seconds,
                 double position[3]);

// bounds.c: computes twist_radius, lipschitz, centre, radius and growth of a node from those of its children; or
// of every node.
void node_bound(struct node *nodes, int index);
void model_bound_nodes(struct model *model);

// hash.c: writes the hash of a checked scene and of the limits in use as hexadecimal text. Returns
// false if memory is short.
bool scene_hash(json_t *root, const struct limits *march, char hash[17]);
