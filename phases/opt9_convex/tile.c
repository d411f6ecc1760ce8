// The pixels of a tile: blocks of neighbours on both axes, four wide, one ray through the middle of each; what
// of a block lies outside the picture is masked, so any size will do.
#include "block.h"
#include "desk.h"
#include "simd/point.h"
#include "trace.h"

#include <stdlib.h>

static struct point split_place(const double a[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(a[i], &hi[i], &lo[i]);
    return (struct point){vec_set(hi), vec_set(lo)};
}

static vmask in_picture(struct block block) {
    COUNT(in_picture, call);
    COUNT(in_picture, cut);
    vfloat below = v_floor(v_iota() * v_splat(1.0f / BLOCK_WIDTH));
    vfloat right = v_iota() - below * v_splat(BLOCK_WIDTH);
    return v_and(v_cmp_lt(right, v_splat((float)block.across)),
                 v_cmp_lt(below, v_splat((float)block.down)));
}

static struct vec get_direction(struct block block, const struct frame *frame,
                                const struct view *view) {
    COUNT(get_direction, call);
    COUNT(get_direction, packet);
    COUNT(get_direction, divide);
    double per_height = view->tan_half_fov / frame->height;
    float columns[LANES], rows[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        COUNT(get_direction, scalar);
        int row = block.row + lane / BLOCK_WIDTH;
        columns[lane] =
            (float)(2 * (block.column + lane % BLOCK_WIDTH) + 1 - frame->width); // exact
        rows[lane] = (float)((frame->height - 1.0 - 2.0 * row) * per_height);
    }
    vfloat x = v_load(columns) * v_splat((float)per_height), y = v_load(rows);
    struct vec d = vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), x);
    d = vec_along(d, vec_from_doubles(view->up), y);
    return vec_scale(d, v_splat(1.0f) / vec_norm(d));
}

static void store(struct frame *frame, struct block block, const struct shaded *seen) {
    COUNT(store, call);
    if (frame->shown) {
        show_block(frame, block, seen->color);
        return;
    }
    store_plane(frame->rgb, 3, frame, block, seen->color.x);
    store_plane(frame->rgb + 1, 3, frame, block, seen->color.y);
    store_plane(frame->rgb + 2, 3, frame, block, seen->color.z);
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

static void draw_tile(const struct job *job, int tile, struct approach *own) {
    COUNT(draw_tile, call);
    COUNT(draw_tile, scalar);
    struct frame *frame = job->frame;
    struct world world = {job->prepared, job->view, own};
    struct point origin = split_place(job->view->position);
    int left = tile % tiles_across(frame) * TILE_WIDTH,
        right = lesser(frame->width, left + TILE_WIDTH);
    int top = tile / tiles_across(frame) * TILE_HEIGHT,
        bottom = lesser(frame->height, top + TILE_HEIGHT);
    for (int row = top; row < bottom; row += BLOCK_HEIGHT) {
        for (int column = left; column < right; column += BLOCK_WIDTH) {
            struct block block = {column, row, lesser(BLOCK_WIDTH, right - column),
                                  lesser(BLOCK_HEIGHT, bottom - row)};
            ACTIVE(block.across * block.down);
            COUNT(draw_tile, packet);
            struct shaded seen;
            trace(origin, get_direction(block, frame, job->view), in_picture(block), 0, &world,
                  &seen);
            ACTIVE(block.across * block.down);
            store(frame, block, &seen);
        }
    }
}

// As many as a Mandelbulb's streams have, if there is one.
static int nears(const struct model *model) {
    return model->features.count[SHAPE_MANDELBULB] ? POOLS : NEARS;
}

// A worker's own is either: approaches to march with, or a desk and what it points to.
size_t VARIANT(own_size)(const struct model *model) {
    size_t shapes = (size_t)model->shape_count, marching = shapes * sizeof(struct approach);
    size_t desk = DESK_SIZE(shapes, nears(model));
    return desk > marching ? desk : marching;
}

int VARIANT(tiles)(const struct job *job) {
    if (job->solids)
        return convex_tiles(job);
    return tiles_across(job->frame) * ((job->frame->height + TILE_HEIGHT - 1) / TILE_HEIGHT);
}

void VARIANT(tile)(const struct job *job, int tile, void *own) {
    if (job->solids)
        convex_tile(job, tile,
                    desk_at(own, job->prepared->model.shape_count, nears(&job->prepared->model)));
    else
        draw_tile(job, tile, own);
}

bool VARIANT(distances)(const struct prepared *prepared, size_t count, const double *points,
                        double *distance, int *nearest) {
    size_t size = (size_t)prepared->model.shape_count * sizeof(struct approach);
    struct approach *approach = aligned_alloc(64, (size + 63) / 64 * 64);
    if (!approach)
        return false;
    struct vec nowhere = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    for (size_t i = 0; i < count; i++) {
        vfloat shape = v_splat(-1.0f);
        approach_origins(split_place(points + 3 * i), prepared, approach);
        approach_directions(nowhere, prepared, approach);
        distance[i] = v_lane0(sdf(approach, v_splat(0.0f), prepared, v_mask_none(), &shape));
        nearest[i] = (int)v_lane0(shape);
    }
    free(approach);
    return true;
}
