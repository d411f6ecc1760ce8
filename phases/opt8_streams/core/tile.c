// Draws the tiles of a picture in blocks, four pixels wide, one ray through the middle of each. Lanes outside the
// picture are masked. One worker draws a strip of tiles: cones of the strip's squares of two by two patches march
// first, one in each lane, then, tile by tile, those of the patches. A patch is a group of packets (two of eight
// lanes).
#include "cones/distance_bounds.h"
#include "cones/tile_cones.h"
#include "core/camera_rays.h"
#include "core/kernel.h"
#include "core/local_rays.h"
#include "core/pixel_rects.h"
#include "core/ray_queues.h"
#include "core/trace.h"
#include "core/trace_context.h"

#include <string.h>

// Returns the rays' directions as get_direction() does, but in doubles. bulb/bulb_single.c needs them: a direction
// rounded to float can miss what the exact ray hits.
static struct vec_double exact_direction(struct pixel_block block, const struct frame *frame,
                                         const struct view *view) {
    double per_height = view->tan_half_fov / frame->height;
    vfloat zero = v_splat(0.0f), row = v_load(row_below) + v_splat((float)block.row);
    vfloat columns =
        v_load(twice_right) + v_splat((float)(2 * block.column + 1 - frame->width)); // exact
    vfloat rows = v_splat((float)(frame->height - 1)) - (row + row);
    vdouble x = v_double_mul(v_double_sum(columns, zero), per_height);
    vdouble y = v_double_mul(v_double_sum(rows, zero), per_height);
    return v_double_look(x, y, view->forward, view->right, view->up);
}

static void store_hit(struct frame *frame, struct pixel_block block, vfloat start, int shapes,
                      const struct hit *hit) {
    store_aov(frame, block, hit->found, hit->t, hit->shape, hit->normal, hit->evals);
    if (frame->plane_count > 0) {
        store_plane(frame->planes[0], 1, frame, block, start);
        store_plane(frame->planes[1], 1, frame, block, v_splat((float)shapes));
    }
}

// Draws a patch whose rays hit nothing.
static void store_background(const struct pixel_rect *patch, const struct job *job) {
    const double *background = job->prepared->model.background;
    struct frame *frame = job->frame;
    float color[3 * PATCH];
    for (int i = 0; i < 3 * PATCH; i++)
        color[i] = (float)background[i % 3];
    size_t width = (size_t)(patch->right - patch->left);
    for (int row = patch->top; row < patch->bottom; row++) {
        size_t first = (size_t)row * (size_t)frame->width + (size_t)patch->left;
        memcpy(frame->rgb + 3 * first, color, 3 * width * sizeof(float));
    }
    if (!frame->depth)
        return;
    struct hit nothing = {.found = v_mask_none(), .shape = v_splat(-1.0f)};
    nothing.t = nothing.evals = v_splat(0.0f);
    nothing.normal = (struct vec){nothing.t, nothing.t, nothing.t};
    for (int i = 0; i < BLOCKS; i++)
        store_hit(frame, block_in_rect(patch, i), v_splat(-1.0f), 0, &nothing); // no start
}

// Whether a cone's rays may meet a Mandelbulb. Their list has all shapes then, and march_camera_stream() or
// march_single_bulb() marches them.
static bool may_meet_bulb(const struct shape_list *list, const struct prepared *scene) {
    return scene->bulbs > 0 && list->fractal;
}

// Queues the camera rays of a patch for the march that begins with the Mandelbulb. `at` is the patch's first pixel in the
// worker's scratch memory.
static void queue_patch(const struct pixel_rect *patch, int at, const struct job *job,
                        struct trace_context *world) {
    for (int i = 0; i < BLOCKS; i++) {
        struct pixel_block block = block_in_rect(patch, i);
        vmask active = in_picture(block);
        if (!v_any(active))
            continue;
        struct vec direction = get_direction(block, job->frame, job->view);
        if (world->single_bulb)
            queue_camera_rays_single(direction, exact_direction(block, job->frame, job->view),
                                     active, at + i * LANES, world);
        else
            queue_camera_rays(direction, active, at + i * LANES, world);
    }
}

// Returns the shapes of the last list_of_cone(), without the Mandelbulbs.
static struct shape_list list_without_bulbs(const struct prepared *scene,
                                            struct march_scratch *scratch) {
    for (int i = 0; i < scene->model.shape_count; i++)
        scratch->wanted[i] = scratch->wanted[i] && scene->primitives[i].trust != BOUND_BALL;
    return list_wanted(scratch->wanted, scene, scratch->patch);
}

// Marches and shades the camera rays of a patch. Colours go into the worker's scratch memory, from pixel `at` on.
static void render_patch(const struct pixel_rect *patch, float start, struct shape_list list,
                         int at, const struct job *job, struct trace_context *world) {
    bool marched = may_meet_bulb(&list, world->scene);
    struct ray_group rays = {.start = v_splat(start)};
    if (marched)
        rays.others = list_without_bulbs(world->scene, world->scratch);
    for (int first = 0; first < BLOCKS; first += GROUP) {
        struct vec color[GROUP];
        struct hit hit[GROUP];
        for (int k = 0; k < GROUP; k++) {
            struct pixel_block block = block_in_rect(patch, first + k);
            rays.active[k] = in_picture(block);
            rays.origin[k] = world->eye;
            rays.direction[k] = get_direction(block, job->frame, job->view);
            rays.weight[k] = v_splat(1.0f);
            rays.pixel[k] = v_iota() + v_splat((float)(at + k * LANES));
            rays.bounce[k] = v_splat(0.0f);
            world->group->packet[k].list = list;
        }
        rays.marched = marched ? at : -1;
        trace(&rays, world, color, hit);
        for (int k = 0; k < GROUP; k++, at += LANES) {
            if (!v_any(rays.active[k]))
                continue;
            v_store(color[k].x, &world->queues->color[0][at]);
            v_store(color[k].y, &world->queues->color[1][at]);
            v_store(color[k].z, &world->queues->color[2][at]);
            if (job->frame->depth)
                store_hit(job->frame, block_in_rect(patch, first + k), v_splat(start), list.count,
                          &hit[k]);
        }
    }
    follow_mirrors(world);
}

static size_t whole_lines(size_t size) {
    return (size + 63) / 64 * 64;
}

// A worker's memory holds its march_scratch, its ray_queues from this offset on, and then the list of occluders.
static size_t scratch_offset(const struct model *model) {
    return whole_lines(march_scratch_size(model));
}

// A tile, or the squares of a strip, in work.
struct tile_in_work {
    int tile;
    unsigned patches; // a bit for each patch whose cone meets a shape
    vmask *met;
    float start[LANES];
};

// Marches the cones of a strip's squares. `squares->tile` is the strip's first tile.
static void begin_strip(struct tile_in_work *squares, const struct job *job,
                        struct trace_context *world) {
    struct cone_packet cones;
    struct pixel_rect square[LANES];
    for (int lane = 0; lane < LANES; lane++)
        square[lane] = rect_of_square(squares->tile, lane, job->frame);
    vmask there = get_cones(square, job, &cones);
    world->scratch->met = squares->met;
    cones.start = v_splat(0.0f);
    set_cone_origins(world->eye, job->prepared, world->scratch);
    march_cones(world->eye, there, job->prepared->all, &cones, job->prepared, world->scratch);
    v_store(cones.start, squares->start);
}

// Marches the cones of a tile's patches. A patch whose cone meets nothing is drawn at once. The rays of a patch that may
// meet a Mandelbulb are queued. `column` is the tile's number in the strip.
static void begin_tile(struct tile_in_work *drawn, int column, const struct tile_in_work *squares,
                       const struct job *job, struct trace_context *world) {
    const struct prepared *scene = job->prepared;
    struct cone_packet cones;
    struct pixel_rect patches[LANES];
    unsigned above = 0;
    int at = column * TILE_PIXELS;
    for (int lane = 0; lane < LANES; lane++) {
        patches[lane] = rect_of_patch(drawn->tile, lane, job->frame);
        above |= 1u << parent_square(column, lane);
        drawn->start[lane] = squares->start[parent_square(column, lane)];
    }
    vmask there = get_cones(patches, job, &cones);
    cones.start = v_load(drawn->start);
    struct shape_list met =
        list_for_children(above, squares->met, scene, world->scratch, world->scratch->offered);
    world->scratch->met = drawn->met;
    march_cones(world->eye, v_cmp_lt_in(there, cones.start, v_splat(INFINITY)), met, &cones, scene,
                world->scratch);
    v_store(cones.start, drawn->start);
    drawn->patches = 0;
    for (unsigned rest = v_mask_bits(there); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest);
        struct pixel_rect patch = patches[lane];
        if (drawn->start[lane] == INFINITY) {
            store_background(&patch, job);
            continue;
        }
        drawn->patches |= 1u << lane;
        struct shape_list list = list_of_cone(lane, scene, world->scratch, &drawn->start[lane]);
        if (may_meet_bulb(&list, scene))
            queue_patch(&patch, at + lane * PATCH * PATCH, job, world);
    }
}

static void render_patches(struct tile_in_work *drawn, int at, const struct job *job,
                           struct trace_context *world) {
    world->scratch->met = drawn->met;
    for (unsigned rest = drawn->patches; rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest);
        struct pixel_rect patch = rect_of_patch(drawn->tile, lane, job->frame);
        struct shape_list list =
            list_of_cone(lane, job->prepared, world->scratch, &drawn->start[lane]);
        render_patch(&patch, drawn->start[lane], list, at + lane * PATCH * PATCH, job, world);
    }
}

static void store_colors(const struct tile_in_work *drawn, int at, const struct job *job,
                         const struct ray_queues *queues) {
    for (unsigned rest = drawn->patches; rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest);
        struct pixel_rect patch = rect_of_patch(drawn->tile, lane, job->frame);
        for (int i = 0; i < BLOCKS; i++) {
            int first = at + lane * PATCH * PATCH + i * LANES;
            struct vec color = {v_load(&queues->color[0][first]), v_load(&queues->color[1][first]),
                                v_load(&queues->color[2][first])};
            store_color(job->frame, block_in_rect(&patch, i), color);
        }
    }
}

static int strips_across(const struct frame *frame) {
    return (tiles_across(frame) + STRIP_TILES - 1) / STRIP_TILES;
}

// Whether the camera is inside of the bounds, by a margin for rounding.
static bool within_bounds(const struct view *view, const struct model *model) {
    const double *at = view->position, most = model->march.bounds_radius * (1 - 1e-6);
    return at[0] * at[0] + at[1] * at[1] + at[2] * at[2] < most * most;
}

void draw_tile(const void *data, int strip, void *memory) {
    const struct job *job = data;
    const struct prepared *scene = job->prepared;
    int shapes = scene->model.shape_count, across = strips_across(job->frame), count = 0;
    struct march_scratch scratch = march_scratch_of(memory, &scene->model);
    struct ray_queues *queues =
        (struct ray_queues *)((char *)memory + scratch_offset(&scene->model));
    queues->occluders = (int *)((char *)queues + whole_lines(sizeof *queues));
    queues->mirrors = queues->shadows = queues->camera_packets = queues->single_count = 0;
    struct packet_group group;
    struct trace_context world = {
        .scene = scene, .view = job->view, .group = &group, .scratch = &scratch, .queues = queues};
    world.eye = point_from_doubles(job->view->position);
    world.single_bulb = scene->single_bulb && within_bounds(job->view, &scene->model);
    place_packets(&group, GROUP, scratch.wake, scratch.local, shapes);
    struct tile_in_work drawn[STRIP_TILES], squares;
    int first = strip % across * STRIP_TILES, row = strip / across * tiles_across(job->frame);
    vmask *met = scratch.met;
    squares.tile = row + first;
    squares.met = met + STRIP_TILES * shapes;
    begin_strip(&squares, job, &world);
    for (; count < STRIP_TILES && first + count < tiles_across(job->frame); count++) {
        drawn[count].tile = row + first + count;
        drawn[count].met = met + count * shapes;
        begin_tile(&drawn[count], count, &squares, job, &world);
    }
    if (queues->camera_packets > 0)
        march_camera_stream(&world);
    if (queues->single_count > 0)
        march_single_bulb(&world);
    for (int i = 0; i < count; i++)
        render_patches(&drawn[i], i * TILE_PIXELS, job, &world);
    cast_shadows(&world);
    for (int i = 0; i < count; i++)
        store_colors(&drawn[i], i * TILE_PIXELS, job, queues);
}

size_t scratch_size(const struct model *model) {
    int shapes = model->shape_count;
    return scratch_offset(model) + whole_lines(sizeof(struct ray_queues)) +
           whole_lines((size_t)shapes * sizeof(int));
}

int count_tiles(const struct job *job) {
    return strips_across(job->frame) * ((job->frame->height + TILE_HEIGHT - 1) / TILE_HEIGHT);
}
