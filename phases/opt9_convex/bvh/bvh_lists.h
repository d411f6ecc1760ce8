// Queries of the BVH: lists of shapes for tiles, packets and batches, and cone queries. Lists for camera and
// mirror rays ascend, so that the first of equal hits wins, as without a BVH.
#pragma once

#include "core/bvh.h"
#include "packet/light_bundle.h"
#include "simd/simd.h"

struct tile_context;
struct worker_scratch;
struct tile_frustum;
struct job;

// Sets scratch->camera_shapes: solids whose bounding sphere meets the frustum, and planes that it sees.
void bvh_list_in_frustum(const struct tile_frustum *frustum, const struct job *job,
                         struct worker_scratch *scratch);

// Sets scratch->row_list and row_counts: of camera_shapes, those that each block of a row may hit; all
// planes. row: the row's frustum; across: a block's width in it.
void bvh_list_in_row(const struct tile_frustum *row, float across, const struct job *job,
                     struct worker_scratch *scratch);

// Sets scratch->occluders for a bundle, whose rays are cones of slope q: the solids that one of them can meet, and all
// planes.
void bvh_list_towards_light(const struct light_bundle *bundle, float q,
                            const struct tile_context *work);

// The same for a batch: sets scratch->batch_count, batch_shape and batch_sphere. Then, for one of its
// packets, scratch->entry_list and entries, from the batch's list if that has room, else from the BVH.
void bvh_list_for_batch(const struct light_bundle *bundle, const struct tile_context *work);
void bvh_list_for_packet(const struct light_bundle *bundle, const struct tile_context *work);

// Lists the shapes whose bounding spheres the rays start in or meet, and all planes. Returns their number.
// `list` has room for LANES more than the scene has shapes.
int bvh_list_along(struct vec origin, struct vec direction, vmask active,
                   const struct tile_context *work, int *list);

// The cones of a packet's rays. Query: does a sphere beyond t come nearer than q·t?
struct ray_cone {
    struct vec point, to_light;
    vfloat q, a, ahead; // a: 1 − q²; ahead: a·t
};

// A packet's rays in a query.
struct packet_cones {
    struct ray_cone rays;
    vfloat t, excluded; // excluded: a shape that is not tested
    vfloat until;       // where the blocker found ends, below 0: none
    vmask open, now;    // open: not in a bundle yet; now: in the current bundle, no blocker found
};

// Finds a blocker for each open ray of at most QUERY_PACKETS packets: a sphere, not of the shape `excluded`, that comes
// into its cone. Sets `until` where there is one. *leaf: the leaf that blocked the last query, tested first.
enum { QUERY_PACKETS = 8 };
void bvh_cone_query(const struct bvh *tree, struct packet_cones *cones, int count, int *leaf);
