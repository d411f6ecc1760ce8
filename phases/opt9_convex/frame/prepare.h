// Setting up a scene and a frame, and the entry points of each lane width. No vectors here: the files that are
// built once share this header.
#pragma once

#include "core/prepared.h"

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
// if not, fallback/ marches it. sixteen: 16 lanes, else 8.
bool set_local_cameras(const struct prepared *prepared, const struct view *view, bool sixteen);
// Returns the height in pixels of the analytic tiles of a frame of this height.
int tile_height(const struct prepared *prepared, int height);

// The entry points of frame/tile.c for each lane width: bytes of a worker's memory, number of tiles, one tile,
// and distances for tests.
#define KERNEL(width)                                                                              \
    size_t width##_scratch_size(const struct model *model);                                        \
    int width##_tiles(const struct job *job);                                                      \
    void width##_tile(const struct job *job, int tile, void *memory);                              \
    bool width##_distances(const struct prepared *prepared, size_t count, const double *points,    \
                           double *distance, int *nearest);
KERNEL(lanes8)
KERNEL(lanes16)
#undef KERNEL
