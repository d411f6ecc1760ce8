// A tile of the picture is one batch of rays: its camera rays, then what they mirror, packed anew, until nothing does.
// Rays packed by blocks of a tile, after J. Bikker, "Architecture of a Real-Time Ray-Tracer".
#include "numerics.h"
#include "simd/permute.h"
#include "trace.h"

static int lesser(int a, int b) {
    return a < b ? a : b;
}

static int tiles_across(const struct frame *frame) {
    return (frame->width + TILE - 1) / TILE;
}

// Of pixel `slot` of a tile: packets are blocks of neighbours on both axes.
static void place_of(int slot, int *column, int *row) {
    int block = slot / LANES, lane = slot % LANES, across = TILE / BLOCK_WIDTH;
    *column = block % across * BLOCK_WIDTH + lane % BLOCK_WIDTH;
    *row = block / across * BLOCK_HEIGHT + lane / BLOCK_WIDTH;
}

// Camera rays of the tile's blocks, in lanes; pixels outside of the picture are left out.
static void get_rays(const struct job *job, int left, int top, struct rays *rays) {
    COUNT(get_rays, call);
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
        COUNT(get_rays, packet);
        vfloat x = v_splat((float)(2 * (left + across) + 1 - frame->width)) + v_load(right_by);
        vfloat y = v_splat((float)(frame->height - 1 - 2 * (top + down))) - v_load(down_by);
        struct vec d = vec_along(ahead, right, x * v_splat(per_height));
        d = vec_along(d, up, y * v_splat(per_height));
        d = vec_scale(d, inverse_root(vec_dot(d, d), newton));
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

static void trace(const struct work *work, const float *own) {
    struct desk *desk = work->desk;
    const struct rays *r = &desk->rays;
    struct beams beams = {{r->origin[0], r->origin[1], r->origin[2]},
                          {r->direction[0], r->direction[1], r->direction[2]},
                          NULL,
                          NULL,
                          own,
                          r->count};
    first_hits(work->scene, &beams, desk->t, desk->shape);
}

static size_t pixel_at(const struct frame *frame, int left, int top, int slot) {
    int column, row;
    place_of(slot, &column, &row);
    return (size_t)(top + row) * (size_t)frame->width + (size_t)(left + column);
}

static void store_hits(const struct desk *desk, int left, int top, struct frame *frame) {
    for (int i = 0; i < desk->rays.count; i++) {
        size_t pixel = pixel_at(frame, left, top, (int)desk->rays.pixel[i]);
        frame->depth[pixel] = desk->t[i];
        frame->id[pixel] = desk->shape[i];
        frame->evals[pixel] = 1;
        for (size_t k = 0; k < 3; k++)
            frame->normal[3 * pixel + k] = desk->shape[i] < 0 ? 0 : desk->normal[k][i];
    }
}

static void store_colors(const struct desk *desk, int left, int top, struct frame *frame) {
    int across = lesser(TILE, frame->width - left), down = lesser(TILE, frame->height - top);
    for (int slot = 0; slot < BATCH; slot++) {
        int column, row;
        place_of(slot, &column, &row);
        if (column >= across || row >= down)
            continue;
        float *to = frame->rgb + 3 * pixel_at(frame, left, top, slot);
        for (int k = 0; k < 3; k++)
            to[k] = desk->color[k][slot];
    }
}

size_t VARIANT(own_size)(void) {
    return sizeof(struct desk);
}

int VARIANT(tiles)(const struct frame *frame) {
    return tiles_across(frame) * ((frame->height + TILE - 1) / TILE);
}

static void draw_tile(const struct job *job, int tile, struct desk *desk) {
    ACTIVE(LANES); // and not what the worker did before: two threads count as one
    COUNT(draw_tile, call);
    struct work work = {job->prepared, job->view, desk};
    int left = tile % tiles_across(job->frame) * TILE, top = tile / tiles_across(job->frame) * TILE;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < BATCH; i += LANES)
            v_store(v_splat(0.0f), desk->color[k] + i);
    get_rays(job, left, top, &desk->rays);
    trace(&work, NULL);
    shade(&work, 0, job->frame->depth != NULL);
    if (job->frame->depth)
        store_hits(desk, left, top, job->frame);
    for (int bounce = 1; desk->mirrored.count > 0; bounce++) {
        desk->rays = desk->mirrored;
        trace(&work, desk->rays.own);
        shade(&work, bounce, false);
    }
    store_colors(desk, left, top, job->frame);
}

void VARIANT(tile)(const struct job *job, int tile, void *own) {
    draw_tile(job, tile, own);
}

void VARIANT(hits)(const struct prepared *prepared, const struct ray_set *rays, size_t first,
                   size_t count) {
    struct beams beams = {.far = rays->far ? rays->far + first : NULL, .count = (int)count};
    for (int k = 0; k < 3; k++) {
        beams.origin[k] = rays->origin[k] + first;
        beams.direction[k] = rays->direction[k] + first;
    }
    if (rays->any)
        blocked(prepared, &beams, rays->t + first);
    else
        first_hits(prepared, &beams, rays->t + first, rays->shape + first);
}
