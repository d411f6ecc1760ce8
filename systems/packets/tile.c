// A tile of the picture is one batch of camera rays, packed by blocks of pixels after J. Bikker,
// "Architecture of a Real-Time Ray-Tracer". Its mirror rays make the next batch, until there is
// none.
#include "ray_arrays.h"
#include "shade.h"
#include "solids.h"

enum {
    TILE = 16, // pixels on a side
    BLOCK_WIDTH = 4,
    BLOCK_HEIGHT = LANES / BLOCK_WIDTH,
    PACKETS = BATCH / LANES
};
_Static_assert(TILE *TILE == BATCH, "a tile's camera rays are one batch");

static int int_min(int a, int b) {
    return a < b ? a : b;
}

static int tiles_across(const struct frame *frame) {
    return (frame->width + TILE - 1) / TILE;
}

// Sets the position in the tile of its pixel `slot`. A packet is a block of pixels.
static void position_of_slot(int slot, int *column, int *row) {
    int block = slot / LANES, lane = slot % LANES, across = TILE / BLOCK_WIDTH;
    *column = block % across * BLOCK_WIDTH + lane % BLOCK_WIDTH;
    *row = block / across * BLOCK_HEIGHT + lane / BLOCK_WIDTH;
}

// Sets the tile's camera rays, without those of pixels outside of the picture.
static void camera_rays(const struct job *job, int left, int top, struct tile_rays *rays) {
    const struct frame *frame = job->frame;
    const struct view *view = job->view;
    bool newton = job->prepared->settings.newton;
    float per_height = (float)(view->tan_half_fov / frame->height);
    float right_by[LANES], down_by[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        right_by[lane] = (float)(2 * (lane % BLOCK_WIDTH));
        down_by[lane] = (float)(2 * (lane / BLOCK_WIDTH));
    }
    struct vec ahead = vec_from_doubles(view->forward), right = vec_from_doubles(view->right);
    struct vec up = vec_from_doubles(view->up), eye = vec_from_doubles(view->position);
    rays->count = 0;
    for (int block = 0; block < PACKETS; block++) {
        int across = block % (TILE / BLOCK_WIDTH) * BLOCK_WIDTH;
        int down = block / (TILE / BLOCK_WIDTH) * BLOCK_HEIGHT;
        int columns = frame->width - left - across, rows = frame->height - top - down;
        if (columns <= 0 || rows <= 0)
            continue;
        vfloat x = v_splat((float)(2 * (left + across) + 1 - frame->width)) + v_load(right_by);
        vfloat y = v_splat((float)(frame->height - 1 - 2 * (top + down))) - v_load(down_by);
        struct vec d = vec_along(ahead, right, x * v_splat(per_height));
        d = vec_along(d, up, y * v_splat(per_height));
        d = vec_scale(d, inverse_sqrt(vec_dot(d, d), newton));
        vmask in = v_and(v_cmp_lt(v_load(right_by), v_splat((float)(2 * columns))),
                         v_cmp_lt(v_load(down_by), v_splat((float)(2 * rows))));
        int to = rays->count;
        pack_vec(in, eye, rays->origin, to);
        pack_vec(in, d, rays->direction, to);
        v_compress_store(in, v_splat(1.0f), rays->weight + to);
        v_compress_store(in, v_splat((float)(block * LANES)) + v_iota(), rays->pixel + to);
        rays->count += v_count(in);
    }
}

static void find_tile_hits(const struct tile_context *context, const float *excluded) {
    struct worker_scratch *scratch = context->scratch;
    const struct tile_rays *r = &scratch->rays;
    struct ray_batch batch = {{r->origin[0], r->origin[1], r->origin[2]},
                              {r->direction[0], r->direction[1], r->direction[2]},
                              NULL,
                              NULL,
                              excluded,
                              r->count};
    find_closest_hits(context->scene, &batch, scratch->t, scratch->shape);
}

static size_t pixel_at(const struct frame *frame, int left, int top, int slot) {
    int column, row;
    position_of_slot(slot, &column, &row);
    return (size_t)(top + row) * (size_t)frame->width + (size_t)(left + column);
}

static void store_hits(const struct worker_scratch *scratch, int left, int top,
                       struct frame *frame) {
    for (int i = 0; i < scratch->rays.count; i++) {
        size_t pixel = pixel_at(frame, left, top, (int)scratch->rays.pixel[i]);
        frame->depth[pixel] = scratch->t[i];
        frame->id[pixel] = scratch->shape[i];
        frame->evals[pixel] = 1;
        for (size_t k = 0; k < 3; k++)
            frame->normal[3 * pixel + k] = scratch->shape[i] < 0 ? 0 : scratch->normal[k][i];
    }
}

static void store_colors(const struct worker_scratch *scratch, int left, int top,
                         struct frame *frame) {
    int across = int_min(TILE, frame->width - left), down = int_min(TILE, frame->height - top);
    for (int slot = 0; slot < BATCH; slot++) {
        int column, row;
        position_of_slot(slot, &column, &row);
        if (column >= across || row >= down)
            continue;
        float *to = frame->rgb + 3 * pixel_at(frame, left, top, slot);
        for (int k = 0; k < 3; k++)
            to[k] = scratch->color[k][slot];
    }
}

static int tiles(const struct frame *frame) {
    return tiles_across(frame) * ((frame->height + TILE - 1) / TILE);
}

static void draw_tile(const void *data, int tile, void *own) {
    const struct job *job = data;
    struct worker_scratch *scratch = own;
    struct tile_context context = {job->prepared, job->view, scratch};
    int left = tile % tiles_across(job->frame) * TILE, top = tile / tiles_across(job->frame) * TILE;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < BATCH; i += LANES)
            v_store(v_splat(0.0f), scratch->color[k] + i);
    camera_rays(job, left, top, &scratch->rays);
    find_tile_hits(&context, NULL);
    shade_batch(&context, 0, job->frame->depth != NULL);
    if (job->frame->depth)
        store_hits(scratch, left, top, job->frame);
    for (int bounce = 1; scratch->mirrored.count > 0; bounce++) {
        scratch->rays = scratch->mirrored;
        find_tile_hits(&context, scratch->rays.excluded);
        shade_batch(&context, bounce, false);
    }
    store_colors(scratch, left, top, job->frame);
}

static void find_hits(const struct prepared *prepared, const struct ray_set *rays, size_t first,
                      size_t count) {
    struct ray_batch batch = {.far = rays->far ? rays->far + first : NULL, .count = (int)count};
    for (int k = 0; k < 3; k++) {
        batch.origin[k] = rays->origin[k] + first;
        batch.direction[k] = rays->direction[k] + first;
    }
    if (rays->any)
        find_occluded(prepared, &batch, rays->t + first);
    else
        find_closest_hits(prepared, &batch, rays->t + first, rays->shape + first);
}

const struct lane_kernel VARIANT(kernel) = {sizeof(struct worker_scratch), tiles, draw_tile,
                                            find_hits};
