// Queries of the BVH: lists of shapes for tiles, packets and batches, and cone queries. Lists for camera and
// mirror rays ascend, so that the first of equal hits wins, as without a BVH.
#ifndef OPT9_BVH_LISTS_H
#define OPT9_BVH_LISTS_H

#include "simd/simd.h"

struct shadow_candidate;
struct shadow_rays;
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

// Sets scratch->occluders for a bundle of shadow rays: they start in a ball, and their directions differ from
// to_light by less than the widening in q. Lists solids that a cone of slope q about such a ray can meet, and
// all planes.
void bvh_list_towards_light(const float centre[3], float radius, const float to_light[3], float q,
                            const struct tile_context *work);

// The same for a batch: sets scratch->batch_count, batch_shape and batch_sphere. Then, for one of its
// packets, scratch->entry_list and entries, from the batch's list if that has room, else from the BVH.
void bvh_list_for_batch(const float centre[3], float radius, const float to_light[3], float q,
                        const struct tile_context *work);

void bvh_list_for_packet(const float centre[3], float radius, const float to_light[3], float q,
                         const struct tile_context *work);

// Lists the shapes whose bounding spheres the rays start in or meet, and all planes. Returns their number.
// `list` has room for LANES more than the scene has shapes.
int bvh_list_along(struct vec origin, struct vec direction, vmask active,
                   const struct tile_context *work, int *list);

// As trivially_lit(), with a cone query for each ray in place of scratch->occluders.
vmask bvh_trivially_lit(struct vec point, struct vec local, struct vec to_light, vfloat facing,
                        vfloat shape, vmask active, const struct tile_context *work);

// Sets the rays' end and their first entry into a solid of scratch->entry_list.
void bvh_first_entry(struct shadow_rays *r, struct shadow_candidate *candidates,
                     const struct tile_context *work);

// A cone query for the rays `queried` of a packet: does any shape but `excluded` come nearer than q·t', for t'
// from t on? Sets `until` in those lanes: where the blocker found ends, below 0 if there is none.
struct cone_request {
    const struct shadow_rays *rays;
    vfloat t, q, until;
    vfloat excluded; // a solid known to stay at q·t or further, −1: none
    vmask queried;
};

// Runs the cone queries of BATCH_PACKETS packets at most.
void bvh_query_ahead(struct cone_request *asking, int count, const struct tile_context *work);

#endif
