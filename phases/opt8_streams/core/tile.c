// The pixels of a tile: blocks of neighbours on both axes, four wide, one ray through the middle of each; what
// of a block lies outside the picture is masked, so any size will do.
#include "core/camera_rays.h"
#include "core/ray_queues.h"
#include "simd/point.h"

#include <stdlib.h>
#include <string.h>

// A strip of tiles is drawn by one worker. Cones march together, one in each lane: first those of squares of two by two
// patches, all that are in the strip, then, tile by tile, those of the four patches in each of them. A patch is a group
// of packets (two of eight lanes). 32 pixels of a row are whole cache lines of every plane where the
// width is a multiple of 32.
enum { BLOCKS = PATCH / BLOCK_WIDTH * (PATCH / BLOCK_HEIGHT) }; // of a patch

// The same in doubles: as floats, rays would pass by what they are to meet.
static struct vec_double exact_direction(struct pixel_block block, const struct frame *frame,
                                         const struct view *view) {
    COUNT(exact_direction, call);
    double per_height = view->tan_half_fov / frame->height;
    vfloat zero = v_splat(0.0f), row = v_load(row_below) + v_splat((float)block.row);
    vfloat columns =
        v_load(twice_right) + v_splat((float)(2 * block.column + 1 - frame->width)); // exact
    vfloat rows = v_splat((float)(frame->height - 1)) - (row + row);
    vdouble x = v_double_mul(v_double_sum(columns, zero), per_height);
    vdouble y = v_double_mul(v_double_sum(rows, zero), per_height);
    vdouble d[3];
    vhalf low = v_half_splat(0.0), high = low;
    for (int i = 0; i < 3; i++) {
        d[i] = v_double_madd(x, view->right[i], v_double_mul(y, view->up[i]));
        d[i] = v_double_sub(d[i], -view->forward[i]);
        low = v_half_madd(d[i].low, d[i].low, low);
        high = v_half_madd(d[i].high, d[i].high, high);
    }
    low = v_half_splat(1.0) / v_half_sqrt(low);
    high = v_half_splat(1.0) / v_half_sqrt(high);
    for (int i = 0; i < 3; i++)
        d[i] = (vdouble){d[i].low * low, d[i].high * high};
    return (struct vec_double){d[0], d[1], d[2]};
}

static void store_hit(struct frame *frame, struct pixel_block block, vfloat start, int shapes,
                      const struct hit *hit) {
    store_plane(frame->depth, 1, frame, block, v_select(hit->found, hit->t, v_splat(INFINITY)));
    store_plane(frame->id, 1, frame, block, hit->shape);
    store_plane(frame->normal, 3, frame, block, hit->normal.x);
    store_plane(frame->normal + 1, 3, frame, block, hit->normal.y);
    store_plane(frame->normal + 2, 3, frame, block, hit->normal.z);
    store_plane(frame->evals, 1, frame, block, hit->evals);
    if (frame->plane_count > 0) {
        store_plane(frame->planes[0], 1, frame, block, start);
        store_plane(frame->planes[1], 1, frame, block, v_splat((float)shapes));
    }
}

static int tiles_across(const struct frame *frame) {
    return (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
}

struct pixel_rect { // of pixels, what of it is in the picture
    int left, top, right, bottom;
};

static struct pixel_rect rect_of_patch(int tile, int lane, const struct frame *frame) {
    int left = tile % tiles_across(frame) * TILE_WIDTH + lane % PATCHES_ACROSS * PATCH;
    int top = tile / tiles_across(frame) * TILE_HEIGHT + lane / PATCHES_ACROSS * PATCH;
    return (struct pixel_rect){left, top, int_min(frame->width, left + PATCH),
                               int_min(frame->height, top + PATCH)};
}

enum { SQUARE = 2 * PATCH, SQUARES_ACROSS = STRIP_TILES * PATCHES_ACROSS / 2 };

static struct pixel_rect rect_of_square(int tile, int lane,
                                        const struct frame *frame) { // the strip's first tile
    int left = tile % tiles_across(frame) * TILE_WIDTH + lane % SQUARES_ACROSS * SQUARE;
    int top = tile / tiles_across(frame) * TILE_HEIGHT + lane / SQUARES_ACROSS * SQUARE;
    return (struct pixel_rect){left, top, int_min(frame->width, left + SQUARE),
                               int_min(frame->height, top + SQUARE)};
}

// The square that a patch is in.
static int parent_square(int column, int lane) {
    return lane / PATCHES_ACROSS / 2 * SQUARES_ACROSS + column * (PATCHES_ACROSS / 2) +
           lane % PATCHES_ACROSS / 2;
}

static struct vec unit(struct vec v) {
    return vec_scale(v, v_splat(1.0f) / vec_norm(v));
}

// Through the middles of the corner pixels: no ray between is further from the axis, since a circle about the
// axis is an ellipse in the picture, and what is between two of its points is within.
static struct cone_packet cones_around(vfloat x[2], vfloat y[2], const struct view *view) {
    COUNT(cones_around, call);
    struct vec corner[4], sum = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (int i = 0; i < 4; i++) {
        corner[i] =
            vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), x[i & 1]);
        corner[i] = unit(vec_along(corner[i], vec_from_doubles(view->up), y[i >> 1]));
        sum = vec_along(sum, corner[i], v_splat(1.0f));
    }
    struct cone_packet cones = {.axis = unit(sum)};
    vfloat most = v_splat(0.0f);
    for (int i = 0; i < 4; i++) {
        struct vec apart = vec_along(corner[i], cones.axis, v_splat(-1.0f));
        most = v_max(most, vec_dot(apart, apart));
    }
    cones.spread = v_madd(v_sqrt(most), v_splat(1.0f + 0x1p-16f), v_splat(0x1p-20f));
    return cones;
}

// A cone for each of them; which of them there are.
static vmask get_cones(const struct pixel_rect patches[LANES], const struct job *job,
                       struct cone_packet *cones) {
    COUNT(get_cones, call);
    const struct frame *frame = job->frame;
    double per_height = job->view->tan_half_fov / frame->height;
    float edge[4][LANES], there[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        COUNT(get_cones, scalar);
        struct pixel_rect p = patches[lane];
        there[lane] = p.left < p.right && p.top < p.bottom ? 1.0f : 0.0f;
        edge[0][lane] = (float)((2.0 * p.left + 1.0 - frame->width) * per_height);
        edge[1][lane] = (float)((2.0 * p.right - 1.0 - frame->width) * per_height);
        edge[2][lane] = (float)((frame->height - 1.0 - 2.0 * p.top) * per_height);
        edge[3][lane] = (float)((frame->height + 1.0 - 2.0 * p.bottom) * per_height);
    }
    vfloat x[2] = {v_load(edge[0]), v_load(edge[1])}, y[2] = {v_load(edge[2]), v_load(edge[3])};
    ACTIVE(LANES);
    *cones = cones_around(x, y, job->view);
    return v_cmp_gt(v_load(there), v_splat(0.5f));
}

static struct pixel_block block_in_rect(const struct pixel_rect *patch, int number) {
    int column = patch->left + number % (PATCH / BLOCK_WIDTH) * BLOCK_WIDTH;
    int row = patch->top + number / (PATCH / BLOCK_WIDTH) * BLOCK_HEIGHT;
    return (struct pixel_block){column, row, int_min(BLOCK_WIDTH, patch->right - column),
                                int_min(BLOCK_HEIGHT, patch->bottom - row)};
}

// Nothing is hit by any of its rays.
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

// Its rays are offered all shapes then, and go by march_camera_stream().
static bool may_meet_bulb(const struct shape_list *list, const struct prepared *scene) {
    return scene->bulbs > 0 && list->shape == scene->all.shape;
}

static void queue_patch(const struct pixel_rect *patch, int at, const struct job *job,
                        struct trace_context *world) {
    COUNT(queue_patch, call);
    for (int i = 0; i < BLOCKS; i++) {
        struct pixel_block block = block_in_rect(patch, i);
        vmask active = in_picture(block);
        ACTIVE(v_count(active));
        COUNT(queue_patch, packet);
        if (!v_any(active))
            continue;
        struct vec direction = get_direction(block, job->frame, job->view);
        if (world->lone)
            queue_camera_rays_single(direction, exact_direction(block, job->frame, job->view),
                                     active, at + i * LANES, world);
        else
            queue_camera_rays(direction, active, at + i * LANES, world);
    }
}

// Into the desk, from place `at` on.
static void render_patch(const struct pixel_rect *patch, float start, struct shape_list list,
                         int at, const struct job *job, struct trace_context *world) {
    COUNT(render_patch, call);
    bool marched = may_meet_bulb(&list, world->scene);
    struct ray_group rays = {.start = v_splat(start)};
    if (marched)
        rays.others = list_without_bulbs(world->scene, world->own);
    for (int first = 0; first < BLOCKS; first += GROUP) {
        struct vec color[GROUP];
        struct hit hit[GROUP];
        for (int k = 0; k < GROUP; k++) {
            struct pixel_block block = block_in_rect(patch, first + k);
            rays.active[k] = in_picture(block);
            ACTIVE(v_count(rays.active[k]));
            COUNT(render_patch, packet);
            rays.origin[k] = world->eye;
            rays.direction[k] = get_direction(block, job->frame, job->view);
            rays.weight[k] = v_splat(1.0f);
            rays.pixel[k] = v_iota() + v_splat((float)(at + k * LANES));
            rays.bounce[k] = v_splat(0.0f);
            world->group.beam[k].list = list;
        }
        rays.marched = marched ? at : -1;
        trace(&rays, world, color, hit);
        for (int k = 0; k < GROUP; k++, at += LANES) {
            if (!v_any(rays.active[k]))
                continue;
            v_store(color[k].x, &world->scratch->color[0][at]);
            v_store(color[k].y, &world->scratch->color[1][at]);
            v_store(color[k].z, &world->scratch->color[2][at]);
            if (job->frame->depth)
                store_hit(job->frame, block_in_rect(patch, first + k), v_splat(start), list.count,
                          &hit[k]);
        }
    }
    if (world->scratch->mirrors > QUEUE / 2)
        follow_mirrors(world);
}

static void init_packet_rays(struct packet_group *group, struct march_scratch *own, int shapes) {
    for (int i = 0; i < shapes * GROUP; i++)
        own->wake[i] = v_splat(INFINITY); // a packet that never was under way wakes nobody
    for (int k = 0; k < GROUP; k++)
        group->beam[k] =
            (struct packet_rays){.approach = own->approach + k * shapes, .wake = own->wake + k};
}

static size_t whole_lines(size_t size) {
    return (size + 63) / 64 * 64;
}

// A worker's memory: its lists and beams, its desk, and what that points to.
static size_t scratch_offset(int shapes) {
    return whole_lines(march_scratch_size(shapes));
}

// A tile in work.
struct tile_in_work {
    int tile;
    unsigned patches; // those that may meet something
    vmask *met;
    float start[LANES];
};

// Cones for the squares of a strip; `squares->tile` is its first one.
static void begin_strip(struct tile_in_work *squares, const struct job *job,
                        struct trace_context *world) {
    struct cone_packet cones;
    struct pixel_rect square[LANES];
    for (int lane = 0; lane < LANES; lane++)
        square[lane] = rect_of_square(squares->tile, lane, job->frame);
    vmask there = get_cones(square, job, &cones);
    world->own->met = squares->met;
    cones.start = v_splat(0.0f);
    set_cone_origins(world->eye, job->prepared, world->own);
    march_cones(world->eye, there, job->prepared->all, &cones, job->prepared, world->own);
    v_store(cones.start, squares->start);
}

// Cones for its patches; what is nothing is drawn, and what may meet a Mandelbulb is queued. `column`: in the strip.
static void begin_tile(struct tile_in_work *drawn, int column, const struct tile_in_work *squares,
                       const struct job *job, struct trace_context *world) {
    COUNT(begin_tile, call);
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
    struct shape_list met = list_for_children(above, squares->met, scene, world->own);
    world->own->met = drawn->met;
    march_cones(world->eye, v_cmp_lt_in(there, cones.start, v_splat(INFINITY)), met, &cones, scene,
                world->own);
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
        struct shape_list list = list_of_cone(lane, scene, world->own, &drawn->start[lane]);
        if (may_meet_bulb(&list, scene))
            queue_patch(&patch, at + lane * PATCH * PATCH, job, world);
    }
}

static void render_patches(struct tile_in_work *drawn, int at, const struct job *job,
                           struct trace_context *world) {
    world->own->met = drawn->met;
    for (unsigned rest = drawn->patches; rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest);
        struct pixel_rect patch = rect_of_patch(drawn->tile, lane, job->frame);
        struct shape_list list = list_of_cone(lane, job->prepared, world->own, &drawn->start[lane]);
        render_patch(&patch, drawn->start[lane], list, at + lane * PATCH * PATCH, job, world);
    }
}

static void store_colors(const struct tile_in_work *drawn, int at, const struct job *job,
                         const struct worker_scratch *scratch) {
    for (unsigned rest = drawn->patches; rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest);
        struct pixel_rect patch = rect_of_patch(drawn->tile, lane, job->frame);
        for (int i = 0; i < BLOCKS; i++) {
            int first = at + lane * PATCH * PATCH + i * LANES;
            struct vec color = {v_load(&scratch->color[0][first]),
                                v_load(&scratch->color[1][first]),
                                v_load(&scratch->color[2][first])};
            store_color(job->frame, block_in_rect(&patch, i), color);
        }
    }
}

static int strips_across(const struct frame *frame) {
    return (tiles_across(frame) + STRIP_TILES - 1) / STRIP_TILES;
}

static bool within_bounds(const struct view *view, const struct model *model) {
    const double *at = view->position, most = model->march.bounds_radius * (1 - 1e-6);
    return at[0] * at[0] + at[1] * at[1] + at[2] * at[2] < most * most;
}

static void draw_strip(const struct job *job, int strip, void *memory) {
    COUNT(draw_strip, call);
    COUNT(draw_strip, scalar);
    const struct prepared *scene = job->prepared;
    int shapes = scene->model.shape_count, across = strips_across(job->frame), count = 0;
    struct march_scratch own = march_scratch_of(memory, shapes);
    struct worker_scratch *scratch =
        (struct worker_scratch *)((char *)memory + scratch_offset(shapes));
    scratch->occluders = (int *)((char *)scratch + whole_lines(sizeof *scratch));
    scratch->mirrors = scratch->shadows = scratch->camera_packets = scratch->single_count = 0;
    struct trace_context world = {
        .scene = scene, .view = job->view, .own = &own, .scratch = scratch};
    world.eye = point_from_doubles(job->view->position);
    world.lone = scene->lone && within_bounds(job->view, &scene->model);
    init_packet_rays(&world.group, &own, shapes);
    struct tile_in_work drawn[STRIP_TILES], squares;
    int first = strip % across * STRIP_TILES, row = strip / across * tiles_across(job->frame);
    vmask *met = own.met;
    squares.tile = row + first;
    squares.met = met + STRIP_TILES * shapes;
    begin_strip(&squares, job, &world);
    for (; count < STRIP_TILES && first + count < tiles_across(job->frame); count++) {
        drawn[count].tile = row + first + count;
        drawn[count].met = met + count * shapes;
        begin_tile(&drawn[count], count, &squares, job, &world);
    }
    if (scratch->camera_packets > 0)
        march_camera_stream(&world);
    if (scratch->single_count > 0)
        march_single_bulb(&world);
    for (int i = 0; i < count; i++)
        render_patches(&drawn[i], i * TILE_PIXELS, job, &world);
    follow_mirrors(&world);
    cast_shadows(&world);
    for (int i = 0; i < count; i++)
        store_colors(&drawn[i], i * TILE_PIXELS, job, scratch);
}

size_t VARIANT(own_size)(const struct model *model) {
    int shapes = model->shape_count;
    return scratch_offset(shapes) + whole_lines(sizeof(struct worker_scratch)) +
           whole_lines((size_t)shapes * sizeof(int));
}

int VARIANT(tiles)(const struct frame *frame) {
    return strips_across(frame) * ((frame->height + TILE_HEIGHT - 1) / TILE_HEIGHT);
}

void VARIANT(tile)(const struct job *job, int tile, void *own) {
    draw_strip(job, tile, own);
}

bool VARIANT(distances)(const struct prepared *prepared, size_t count, const double *points,
                        double *distance, int *nearest) {
    size_t size = VARIANT(own_size)(&prepared->model);
    void *own = aligned_alloc(64, (size + 63) / 64 * 64);
    if (!own)
        return false;
    struct march_scratch parts = march_scratch_of(own, prepared->model.shape_count);
    struct packet_rays all = {parts.approach, prepared->all, parts.wake, v_splat(0.0f)},
                       *beam = &all;
    struct vec nowhere = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (size_t i = 0; i < count; i++) {
        vfloat shape = v_splat(-1.0f);
        approach_origins(point_from_doubles(points + 3 * i), prepared, beam);
        approach_directions(nowhere, prepared, beam);
        distance[i] =
            v_lane0(nearest_shape_at(beam, v_splat(0.0f), prepared, v_mask_all(), &shape));
        nearest[i] = (int)v_lane0(shape);
    }
    free(own);
    return true;
}
