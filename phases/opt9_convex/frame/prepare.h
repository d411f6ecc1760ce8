// Setting up a scene and a frame. No vectors here: the files that are built once share this header.
#pragma once

#include "core/prepared.h"
#include "workers/lane_kernel.h"

// Allocates the arrays for the model's shapes. Precondition: *prepared is zeroed. Returns false if memory is
// short; the caller frees `prepared` in either case.
bool reserve_prepared(struct prepared *prepared, const struct model *model);
// Takes a group apart (frame/sharp_groups.c), relative to the centre of its sphere. Returns false if it has a blend, a
// modifier other than a mirror, or a shape that is not convex. Of its solids only the frames are set.
struct sharp;
bool take_sharp(struct sharp *sharp, const struct shape *group, const float centre[3]);
void free_prepared(struct prepared *prepared);
// Sets everything but `cameras`. Precondition: reserve_prepared() returned true.
void prepare_shapes(struct prepared *prepared, const struct model *model);
// Sets prepared->cameras for a frame (frame/local_cameras.c). Returns whether closed forms can draw the frame;
// if not, fallback/ marches it.
bool set_local_cameras(const struct prepared *prepared, const struct view *view,
                       const struct lane_kernel *lanes);
// Returns the height in pixels of the analytic tiles of a frame of this height.
int tile_height(const struct prepared *prepared, int height);
