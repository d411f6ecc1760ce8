// Scenes of more shapes than can be asked one by one: which of them matter, from the tree of their bounding spheres.
// The lists for camera and mirror rays are by ascending number, so that of equals the first wins, as in a small scene.
#ifndef OPT9_BVH_LISTS_H
#define OPT9_BVH_LISTS_H

#include "simd/vec.h"

struct shadow_candidate;
struct shadow_rays;
struct tile_context;
struct worker_scratch;

struct tile_frustum;

struct job;

// To desk->listed: those that lie across the frustum, and planes seen through it.
void bvh_list_in_frustum(const struct tile_frustum *frustum, const struct job *job,
                         struct worker_scratch *scratch);

// Of those the ones that each block of a row can meet, planes all of them: desk->cut, as many as desk->cuts says. `row`:
// its frustum; `across`: how wide that of a block is.
void bvh_list_in_row(const struct tile_frustum *row, float across, const struct job *job,
                     struct worker_scratch *scratch);

// To desk->shading: those that a cone of slope q about a ray can meet, which starts in the ball and goes to_light but for
// `spread`.
void bvh_list_towards_light(const float centre[3], float radius, const float to_light[3], float q,
                            const struct tile_context *work);

// The same solids of all rays of a batch: desk->about, if there is room; then desk->ahead of a packet's, without the tree.
void bvh_list_for_batch(const float centre[3], float radius, const float to_light[3], float q,
                        const struct tile_context *work);

void bvh_list_for_packet(const float centre[3], float radius, const float to_light[3], float q,
                         const struct tile_context *work);

// Those whose bounding spheres any of the rays starts in or meets; how many. `list` has room for LANES more than the scene has
// shapes (bvh_list).
int bvh_list_along(struct vec origin, struct vec direction, vmask active,
                   const struct tile_context *work, int *list);

// What trivially_lit() tells of a small scene, ray by ray.
vmask bvh_trivially_lit(struct vec point, struct vec local, struct vec to_light, vfloat facing,
                        vfloat shape, vmask active, const struct tile_context *work);

// Sets the rays' end, their first entry into one of the solids in desk->ahead, and how far planes' rays can leap.
void bvh_first_entry(struct shadow_rays *r, struct shadow_candidate *candidates,
                     const struct tile_context *work);

// Of a packet's rays `asked`: does anything but `own` come nearer than q·t, from t to the end? `until` is set to where what is
// in the way ends, in those lanes alone; less than 0 where nothing is. Of BATCH_PACKETS packets at most.
struct cone_request {
    const struct shadow_rays *rays;
    vfloat t, q, until;
    vfloat excluded; // a solid that comes no nearer than that any more, −1: none is known
    vmask asked;
};

void bvh_query_ahead(struct cone_request *asking, int count, const struct tile_context *work);

#endif
