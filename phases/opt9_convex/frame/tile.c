// The entry points for one lane width, and the tiles of frames that are marched: blocks of 4 × LANES/4
// pixels, one ray through the middle of each. Lanes outside the picture are masked.
#include <stdlib.h>

#include "core/camera_rays.h"
#include "fallback/trace.h"
#include "frame/prepare.h"
#include "frame/tile.h"
#include "frame/worker_scratch.h"
#include "hit/solids.h"
#include "phase.h"
#include "types/ideal.h"

static void store_block_result(struct frame *frame, struct pixel_block block,
                               const struct shaded *seen) {
    store_block(frame, block, seen->color);
    if (!frame->depth)
        return;
    const struct hit *hit = &seen->hit;
    store_aov(frame, block, hit->found, hit->t, hit->shape, hit->normal, hit->evals);
}

static int tiles_across(const struct frame *frame) {
    return (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
}

static void draw_tile(const struct job *job, int tile, struct local_ray *local_rays) {
    struct frame *frame = job->frame;
    struct trace_context world[TURNS];
    for (int k = 0; k < TURNS; k++)
        world[k] = (struct trace_context){job->prepared, job->view,
                                          local_rays + k * job->prepared->model.shape_count};
    struct point origin = point_from_doubles(job->view->position);
    int left = tile % tiles_across(frame) * TILE_WIDTH,
        right = int_min(frame->width, left + TILE_WIDTH);
    int top = tile / tiles_across(frame) * TILE_HEIGHT,
        bottom = int_min(frame->height, top + TILE_HEIGHT);
    for (int row = top; row < bottom; row += BLOCK_HEIGHT) {
        for (int column = left; column < right; column += TURNS * BLOCK_WIDTH) {
            struct pixel_block block[TURNS];
            struct ray_packets rays;
            struct shaded seen[TURNS];
            for (int k = 0; k < TURNS; k++) {
                int x = column + k * BLOCK_WIDTH;
                block[k] = (struct pixel_block){x, row, int_min(BLOCK_WIDTH, right - x),
                                                int_min(BLOCK_HEIGHT, bottom - row)};
                rays.origin[k] = origin;
                rays.direction[k] = get_direction(block[k], frame, job->view);
                rays.active[k] = in_picture(block[k]);
            }
            trace(&rays, 0, world, seen);
            for (int k = 0; k < TURNS && block[k].across > 0; k++)
                store_block_result(frame, block[k], &seen[k]);
        }
    }
}

// Returns the number of packets of shadow rays that have candidates.
static int candidate_slots(const struct model *model) {
    return model->features.count[SHAPE_MANDELBULB] ? REFILLED_PACKETS : CANDIDATE_SLOTS;
}

// Returns the bytes of a worker's memory: scratch for analytic tiles, or the rays in each shape's frame for
// marched ones.
static size_t scratch_size(const struct model *model) {
    size_t shapes = (size_t)model->shape_count,
           marching = TURNS * shapes * sizeof(struct local_ray);
    // With STEPWISE_PATH=bvh a smaller scene has a BVH: its reads behind the last shape need the room of
    // BVH_MIN_SHAPES.
    size_t room = shapes > BVH_MIN_SHAPES ? shapes : BVH_MIN_SHAPES;
    size_t scratch = SCRATCH_SIZE(room, candidate_slots(model));
    return scratch > marching ? scratch : marching;
}

static int tiles(const struct job *job) {
    if (job->analytic)
        return count_tiles(job);
    return tiles_across(job->frame) * ((job->frame->height + TILE_HEIGHT - 1) / TILE_HEIGHT);
}

static void draw_any_tile(const void *data, int tile, void *memory) {
    const struct job *job = data;
    if (job->analytic)
        draw_analytic_tile(job, tile,
                           scratch_at(memory, job->prepared->model.shape_count,
                                      candidate_slots(&job->prepared->model)));
    else
        draw_tile(job, tile, memory);
}

static bool distances(const struct prepared *prepared, size_t count, const double *points,
                      double *distance, int *nearest) {
    size_t size = (size_t)prepared->model.shape_count * sizeof(struct local_ray);
    struct local_ray *local_rays = aligned_alloc(64, (size + 63) / 64 * 64);
    if (!local_rays)
        return false;
    struct vec nowhere = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (size_t i = 0; i < count; i++) {
        vfloat shape = v_splat(-1.0f);
        set_local_origins(point_from_doubles(points + 3 * i), prepared, local_rays);
        set_local_directions(nowhere, prepared, local_rays);
        distance[i] = v_lane0(sdf(local_rays, v_splat(0.0f), prepared, v_mask_none(), &shape));
        nearest[i] = (int)v_lane0(shape);
    }
    free(local_rays);
    return true;
}

static const struct group_calls group_calls = {
    field_row,     field_in_frustum, field_distance, field_surface,
    sharp_surface, field_enter,      sharp_enter,    SOFT_IS_IDEAL ? field_widest : NULL};

const struct lane_kernel VARIANT(kernel) = {scratch_size, tiles, draw_any_tile, distances,
                                            &group_calls};
