// Draws the tiles of a picture. A tile's pixels are drawn in blocks, four wide, with one ray through the middle of
// each pixel. Lanes of a block outside the picture are masked, so the picture may have any size.
#include "cones/march_scratch.h"
#include "cones/pixel_cones.h"
#include "cones/tile_cones.h"
#include "core/camera_rays.h"
#include "core/kernel.h"
#include "core/local_rays.h"
#include "core/trace.h"
#include "core/trace_context.h"

// One worker draws a tile. Cones march first, one in each lane: those of squares of PATCH << TOP_LEVEL pixels, then,
// quarter by quarter, those of the four squares in each, down to the patches. A patch is one group of packets (two
// with 8 lanes).
enum { PATCH = 8, PATCHES_ACROSS = 4 };
enum { PATCHES_DOWN = LANES / PATCHES_ACROSS, TOP_LEVEL = CONE_LEVELS - 1 };
enum {
    TILE_WIDTH = PATCHES_ACROSS * PATCH << TOP_LEVEL,
    TILE_HEIGHT = PATCHES_DOWN * PATCH << TOP_LEVEL
};
enum { BLOCKS = PATCH / BLOCK_WIDTH * (PATCH / BLOCK_HEIGHT) }; // in a patch
enum {
    BULB_PATCHES = (int)GROUP > (int)BLOCKS ? (int)GROUP / (int)BLOCKS : 1
}; // patches in a large group

static void store_block_result(struct frame *frame, struct pixel_block block, vfloat start,
                               int shapes, const struct shaded *seen) {
    store_color(frame, block, seen->color);
    if (!frame->depth)
        return;
    const struct hit *hit = &seen->hit;
    store_aov(frame, block, hit->found, hit->t, hit->shape, hit->normal, hit->evals);
    if (frame->plane_count > 0) {
        store_plane(frame->planes[0], 1, frame, block, start);
        store_plane(frame->planes[1], 1, frame, block, v_splat((float)shapes));
    }
}

static int tiles_across(const struct frame *frame) {
    return (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
}

// Cones that march together: each lane has a square of PATCH << level pixels.
struct cone_area {
    int left, top, level;
};

static struct pixel_rect rect_of_lane(struct cone_area area, int lane, const struct frame *frame) {
    int size = PATCH << area.level;
    int left = area.left + lane % PATCHES_ACROSS * size;
    int top = area.top + lane / PATCHES_ACROSS * size;
    return (struct pixel_rect){left, top, int_min(frame->width, left + size),
                               int_min(frame->height, top + size)};
}

static struct cone_area child_area(struct cone_area area, int quarter) {
    int half = (PATCH << area.level) / 2;
    return (struct cone_area){area.left + quarter % 2 * PATCHES_ACROSS * half,
                              area.top + quarter / 2 * PATCHES_DOWN * half, area.level - 1};
}

// Returns the lane of the wider cone that holds a lane's cone. `quarter` is the cones' quarter of the wider area.
static int parent_lane(int quarter, int lane) {
    int column = quarter % 2 * PATCHES_ACROSS + lane % PATCHES_ACROSS;
    int row = quarter / 2 * PATCHES_DOWN + lane / PATCHES_ACROSS;
    return row / 2 * PATCHES_ACROSS + column / 2;
}

static struct pixel_block block_in_rect(const struct pixel_rect *patch, int number) {
    int column = patch->left + number % (PATCH / BLOCK_WIDTH) * BLOCK_WIDTH;
    int row = patch->top + number / (PATCH / BLOCK_WIDTH) * BLOCK_HEIGHT;
    return (struct pixel_block){column, row, int_min(BLOCK_WIDTH, patch->right - column),
                                int_min(BLOCK_HEIGHT, patch->bottom - row)};
}

// Draws a patch whose rays hit nothing.
static void store_background(const struct pixel_rect *patch, const struct job *job) {
    struct shaded nothing = {.color = vec_from_doubles(job->prepared->model.background)};
    nothing.hit.found = v_mask_none();
    nothing.hit.shape = v_splat(-1.0f);
    nothing.hit.t = nothing.hit.evals = v_splat(0.0f);
    nothing.hit.normal = (struct vec){v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (int i = 0; i < BLOCKS; i++)
        store_block_result(job->frame, block_in_rect(patch, i), v_splat(-1.0f), 0,
                           &nothing); // no start
}

// Draws patches that share a start and a list, `size` packets at a time.
static void render_patches(const struct pixel_rect *patch, int patches, int size,
                           struct point origin, vfloat start, struct shape_list list,
                           const struct job *job, struct trace_context *world) {
    struct point origins[GROUP];
    struct vec direction[GROUP];
    vmask active[GROUP];
    const struct ray_group rays = {origins, direction, active, start};
    int blocks = patches * BLOCKS;
    for (int first = 0; first < blocks; first += size) {
        struct shaded seen[GROUP];
        set_group_size(world->group, size);
        for (int k = 0; k < size; k++) {
            active[k] = v_mask_none();
            if (first + k >= blocks)
                continue;
            struct pixel_block block =
                block_in_rect(&patch[(first + k) / BLOCKS], (first + k) % BLOCKS);
            active[k] = in_picture(block);
            origins[k] = origin;
            direction[k] = get_direction(block, job->frame, job->view);
            world->group->packet[k].list = list;
        }
        trace(&rays, 0, world, seen);
        for (int k = 0; k < size && first + k < blocks; k++) {
            struct pixel_block block =
                block_in_rect(&patch[(first + k) / BLOCKS], (first + k) % BLOCKS);
            store_block_result(job->frame, block, start, list.count, &seen[k]);
        }
    }
}

// Where the rays of each lane's square begin: no ray is hit before. +∞: no ray is hit at all.
struct cone_starts {
    float lane[LANES];
};

// Draws the patches of an area. Patches that can meet a fractal have the list of all shapes and start at the
// camera. They are collected until they fill a large group.
static void draw_lanes(struct cone_area area, vmask there, struct cone_starts start,
                       struct point origin, const struct job *job, struct trace_context *world) {
    struct pixel_rect waiting[BULB_PATCHES];
    int count = 0;
    for (int lane = 0; lane < LANES; lane++) {
        if (!(v_mask_bits(there) >> lane & 1))
            continue;
        struct pixel_rect patch = rect_of_lane(area, lane, job->frame);
        if (start.lane[lane] == INFINITY) {
            store_background(&patch, job);
            continue;
        }
        struct shape_list list =
            list_of_cone(lane, world->scene, world->scratch, &start.lane[lane]);
        if (!list.fractal) {
            render_patches(&patch, 1, SMALL_GROUP, origin, v_splat(start.lane[lane]), list, job,
                           world);
            continue;
        }
        waiting[count++] = patch;
        if (count == BULB_PATCHES) {
            render_patches(waiting, count, GROUP, origin, v_splat(0.0f), list, job, world);
            count = 0;
        }
    }
    if (count > 0)
        render_patches(waiting, count, GROUP, origin, v_splat(0.0f), world->scene->all, job, world);
}

// Marches the cones of an area from the starts of the wider cones, among the shapes these have met. Then draws the
// areas below.
static void draw_area(struct cone_area area, struct cone_starts start, struct shape_list offered,
                      struct point origin, const struct job *job, struct trace_context *world) {
    struct cone_packet cones;
    struct pixel_rect square[LANES];
    for (int lane = 0; lane < LANES; lane++)
        square[lane] = rect_of_lane(area, lane, job->frame);
    vmask there = get_cones(square, job, &cones);
    cones.start = v_load(start.lane);
    world->scratch->met = world->scratch->levels[area.level];
    march_cones(origin, v_cmp_lt_in(there, cones.start, v_splat(INFINITY)), offered, &cones,
                world->scene, world->scratch);
    v_store(cones.start, start.lane);
    if (area.level == 0) {
        draw_lanes(area, there, start, origin, job, world);
        return;
    }
    for (int quarter = 0; quarter < 4; quarter++) {
        struct cone_starts below;
        unsigned above = 0;
        for (int lane = 0; lane < LANES; lane++) {
            below.lane[lane] = start.lane[parent_lane(quarter, lane)];
            above |= 1u << parent_lane(quarter, lane);
        }
        struct shape_list met =
            list_for_children(above, world->scratch->levels[area.level], world->scene,
                              world->scratch, world->scratch->offered[area.level]);
        draw_area(child_area(area, quarter), below, met, origin, job, world);
    }
}

void draw_tile(const void *data, int tile, void *memory) {
    const struct job *job = data;
    struct point origin = point_from_doubles(job->view->position);
    const struct prepared *scene = job->prepared;
    struct march_scratch scratch = march_scratch_of(memory, &scene->model);
    struct packet_group group;
    struct trace_context world = {scene, job->view, &group, &scratch};
    place_packets(&group, scratch.packets, scratch.wake, scratch.local, scene->model.shape_count);
    set_cone_origins(origin, scene, &scratch);
    struct cone_area whole = {tile % tiles_across(job->frame) * TILE_WIDTH,
                              tile / tiles_across(job->frame) * TILE_HEIGHT, TOP_LEVEL};
    draw_area(whole, (struct cone_starts){{0}}, scene->all, origin, job, &world);
}

size_t scratch_size(const struct model *model) {
    return march_scratch_size(model);
}

int count_tiles(const struct job *job) {
    return tiles_across(job->frame) * ((job->frame->height + TILE_HEIGHT - 1) / TILE_HEIGHT);
}
