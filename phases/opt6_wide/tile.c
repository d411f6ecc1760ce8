// The pixels of a tile: blocks of neighbours on both axes, four wide, one ray through the middle of each; what
// of a block lies outside the picture is masked, so any size will do.
#include "simd/point.h"
#include "simd/rgb.h"
#include "trace.h"

#include <stdlib.h>

// 32 pixels of a row are whole cache lines of every plane where the width is a multiple of 32. A tile takes
// some 30 µs of scene0, hundreds of times the contended counter.
enum { TILE_WIDTH = 32, TILE_HEIGHT = 8, BLOCK_WIDTH = 4, BLOCK_HEIGHT = LANES / BLOCK_WIDTH };

static struct point place_of(const double a[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(a[i], &hi[i], &lo[i]);
    return (struct point){vec_set(hi), vec_set(lo)};
}

struct block {
    int column, row;  // of lane 0; lane i is i % 4 to the right and i / 4 below
    int across, down; // what of it is in the picture
};

// Of a block's lanes: twice the column, and the row.
static const float twice_right[16] = {0, 2, 4, 6, 0, 2, 4, 6, 0, 2, 4, 6, 0, 2, 4, 6};
static const float row_below[16] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};

static vmask in_picture(struct block block) {
    return v_and(v_cmp_lt(v_load(twice_right), v_splat(2.0f * (float)block.across)),
                 v_cmp_lt(v_load(row_below), v_splat((float)block.down)));
}

static struct vec get_direction(struct block block, const struct frame *frame,
                                const struct view *view) {
    COUNT(get_direction, call);
    COUNT(get_direction, scalar);
    double per_height = view->tan_half_fov / frame->height, top = frame->height - 1.0;
    // By masks: a register that is loaded from floats just stored one by one waits for all of them.
    vfloat y = v_splat(0.0f);
    for (int i = 0; i < BLOCK_HEIGHT; i++) {
        COUNT(get_direction, row);
        vfloat row = v_splat((float)((top - 2.0 * (block.row + i)) * per_height));
        y = i == 0 ? row : v_select(v_cmp_lt(v_load(row_below), v_splat((float)i)), y, row);
    }
    vfloat columns =
        v_load(twice_right) + v_splat((float)(2 * block.column + 1 - frame->width)); // exact
    vfloat x = columns * v_splat((float)per_height);
    struct vec d = vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), x);
    d = vec_along(d, vec_from_doubles(view->up), y);
    return vec_scale(d, v_splat(1.0f) / vec_norm(d));
}

static void store_plane(float *plane, int stride, const struct frame *frame, struct block block,
                        vfloat values) {
    float lanes[LANES];
    v_store(values, lanes);
    for (int row = 0; row < block.down; row++) {
        size_t first = (size_t)(block.row + row) * (size_t)frame->width + (size_t)block.column;
        for (int i = 0; i < block.across; i++)
            plane[(first + (size_t)i) * (size_t)stride] = lanes[row * BLOCK_WIDTH + i];
    }
}

static void store_color(struct frame *frame, struct block block, struct vec color) {
    size_t width = (size_t)frame->width;
    float *rgb = frame->rgb + 3 * ((size_t)block.row * width + (size_t)block.column);
    if (block.across == BLOCK_WIDTH && block.down == BLOCK_HEIGHT) {
        v_store_block(rgb, 3 * width, color.x, color.y, color.z);
        return;
    }
    store_plane(frame->rgb, 3, frame, block, color.x);
    store_plane(frame->rgb + 1, 3, frame, block, color.y);
    store_plane(frame->rgb + 2, 3, frame, block, color.z);
}

static void store(struct frame *frame, struct block block, const struct shaded *seen) {
    COUNT(store, call);
    store_color(frame, block, seen->color);
    if (!frame->depth)
        return;
    const struct hit *hit = &seen->hit;
    store_plane(frame->depth, 1, frame, block, v_select(hit->found, hit->t, v_splat(INFINITY)));
    store_plane(frame->id, 1, frame, block, hit->shape);
    store_plane(frame->normal, 3, frame, block, hit->normal.x);
    store_plane(frame->normal + 1, 3, frame, block, hit->normal.y);
    store_plane(frame->normal + 2, 3, frame, block, hit->normal.z);
    store_plane(frame->evals, 1, frame, block, hit->evals);
}

static int tiles_across(const struct frame *frame) {
    return (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
}

static int lesser(int a, int b) {
    return a < b ? a : b;
}

// In a worker's own memory.
static void place_beams(struct group *group, void *own, int shapes) {
    vfloat *wake = own;
    struct approach *approach = (struct approach *)(wake + shapes * GROUP);
    for (int i = 0; i < shapes * GROUP; i++)
        wake[i] = v_splat(INFINITY); // a packet that never was under way wakes nobody
    for (int k = 0; k < GROUP; k++)
        group->beam[k] = (struct beam){.approach = approach + k * shapes, .wake = wake + k};
}

// Blocks of one column after the other, GROUP at a time.
static void draw_tile(const struct job *job, int tile, void *own) {
    COUNT(draw_tile, call);
    COUNT(draw_tile, scalar);
    struct frame *frame = job->frame;
    struct world world = {.scene = job->prepared, .view = job->view};
    place_beams(&world.group, own, job->prepared->model.shape_count);
    struct point origin = place_of(job->view->position);
    int left = tile % tiles_across(frame) * TILE_WIDTH,
        right = lesser(frame->width, left + TILE_WIDTH);
    int top = tile / tiles_across(frame) * TILE_HEIGHT,
        bottom = lesser(frame->height, top + TILE_HEIGHT);
    int down = (bottom - top + BLOCK_HEIGHT - 1) / BLOCK_HEIGHT;
    int blocks = (right - left + BLOCK_WIDTH - 1) / BLOCK_WIDTH * down;
    for (int first = 0; first < blocks; first += GROUP) {
        struct block block[GROUP];
        struct rays rays;
        struct shaded seen[GROUP];
        for (int k = 0; k < GROUP; k++) {
            int column = left + (first + k) / down * BLOCK_WIDTH;
            int row = top + (first + k) % down * BLOCK_HEIGHT;
            block[k] = (struct block){column, row,
                                      first + k < blocks ? lesser(BLOCK_WIDTH, right - column) : 0,
                                      lesser(BLOCK_HEIGHT, bottom - row)};
            ACTIVE(block[k].across * block[k].down);
            COUNT(draw_tile, packet);
            rays.origin[k] = origin;
            rays.direction[k] = get_direction(block[k], frame, job->view);
            rays.active[k] = in_picture(block[k]);
        }
        trace(&rays, 0, &world, seen);
        for (int k = 0; k < GROUP; k++) {
            ACTIVE(block[k].across * block[k].down);
            store(frame, block[k], &seen[k]);
        }
    }
}

size_t VARIANT(own_size)(const struct model *model) {
    return GROUP * (size_t)model->shape_count * (sizeof(vfloat) + sizeof(struct approach));
}

int VARIANT(tiles)(const struct frame *frame) {
    return tiles_across(frame) * ((frame->height + TILE_HEIGHT - 1) / TILE_HEIGHT);
}

void VARIANT(tile)(const struct job *job, int tile, void *own) {
    draw_tile(job, tile, own);
}

bool VARIANT(distances)(const struct prepared *prepared, size_t count, const double *points,
                        double *distance, int *nearest) {
    size_t size = VARIANT(own_size)(&prepared->model);
    void *own = aligned_alloc(64, (size + 63) / 64 * 64);
    if (!own)
        return false;
    struct group group;
    place_beams(&group, own, prepared->model.shape_count);
    struct beam *beam = &group.beam[0];
    struct vec nowhere = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (size_t i = 0; i < count; i++) {
        vfloat shape = v_splat(-1.0f);
        approach_origins(place_of(points + 3 * i), prepared, beam);
        approach_directions(nowhere, prepared, beam->approach);
        distance[i] =
            v_lane0(nearest_shape(beam->approach, v_splat(0.0f), prepared, v_mask_all(), &shape));
        nearest[i] = (int)v_lane0(shape);
    }
    free(own);
    return true;
}
