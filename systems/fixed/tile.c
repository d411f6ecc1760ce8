// Renders a tile, the article's render(): a block of 16 × 16 pixels is cleared if no ray can hit, else traced packet by
// packet. Built once for each number of lanes.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
#include "tile.h"

#include <string.h>

#include "intersect.h"
#include "shade.h"

struct block {
    int column, row, width, height; // in pixels, from the top left
};

// Returns whether any of the rays through the block's corners hits a sphere, before or behind the camera.
// The article's test: a sphere inside of the block that covers no corner is missed.
static bool corner_rays_hit(struct block b, const struct scene_tables *scene,
                            const struct frame *frame) {
    enum { ROOM = LANES > 4 ? LANES : 4 };
    scalar across[ROOM], up[ROOM];
    for (int i = 0; i < ROOM; i++) {
        across[i] = 2 * (b.column + (i & 1) * (b.width - 1)) + 1 - frame->width;
        up[i] = frame->height - 1 - 2 * (b.row + (i >> 1 & 1) * (b.height - 1));
    }
    for (int first = 0; first < 4; first += LANES) {
        struct vec direction = camera_direction(v_load(across + first), v_load(up + first), scene);
        for (int i = 0; i < scene->count; i++) {
            struct vec eye = {v_splat(scene->eye[0][i]), v_splat(scene->eye[1][i]),
                              v_splat(scene->eye[2][i])};
            vnum b_term = v_dot(eye, direction, &scene->format);
            if (v_any(v_positive(
                    v_add(v_mul(b_term, b_term, &scene->format), v_splat(scene->minus_c[i])))))
                return true;
        }
    }
    return false;
}

// Writes the indices of the spheres that the block's camera rays are tested against, and returns how many.
// 0: the block is cleared. The format's `clear` says which test decides.
static int find_candidates(struct block b, const struct scene_tables *scene,
                           const struct frame *frame, int *candidates) {
    enum clear clear = scene->format.clear;
    int count = 0, column = b.column / BLOCK, row = b.row / BLOCK;
    if (clear == CLEAR_CORNERS && !corner_rays_hit(b, scene, frame))
        return 0;
    for (int i = 0; i < scene->count; i++)
        if (clear == CLEAR_CORNERS || clear == CLEAR_NEVER ||
            (scene->blocks[0][i] <= column && column <= scene->blocks[1][i] &&
             scene->blocks[2][i] <= row && row <= scene->blocks[3][i]))
            candidates[count++] = i;
    if (clear == CLEAR_SAFE && count > 0) // only empty blocks gain: the others test all spheres
        for (count = 0; count < scene->count; count++)
            candidates[count] = count;
    return count;
}

// Fills the block with the background, as misses.
static void clear_block(struct block b, const struct scene_tables *scene, struct frame *frame) {
    for (int row = b.row; row < b.row + b.height; row++)
        for (int column = b.column; column < b.column + b.width; column++) {
            size_t pixel = (size_t)row * (size_t)frame->width + (size_t)column;
            memcpy(frame->rgb + 3 * pixel, scene->exact_background, sizeof scene->exact_background);
            if (!frame->depth)
                continue;
            frame->depth[pixel] = INFINITY;
            frame->id[pixel] = -1;
            memset(frame->normal + 3 * pixel, 0, 3 * sizeof(float));
            frame->evals[pixel] = 1;
            if (frame->plane_count)
                frame->planes[0][pixel] = 1;
        }
}

// Writes depth, shape, normal and evaluation count of the first `count` lanes, from pixel `first` on.
// Normals are made unit again in doubles, as the number format rounds them.
static void store_aov(const struct shaded *result, size_t first, int count,
                      const struct scene_tables *scene, struct frame *frame) {
    const struct format *f = &scene->format;
    float t[LANES], shape[LANES];
    double normal[3][LANES];
    v_store_float(result->hit.t, f->length_scale, t);
    v_store_float(result->hit.shape, 1, shape);
    v_store_double(result->normal.x, f->scale, normal[0]);
    v_store_double(result->normal.y, f->scale, normal[1]);
    v_store_double(result->normal.z, f->scale, normal[2]);
    for (int lane = 0; lane < count; lane++) {
        size_t pixel = first + (size_t)lane;
        bool hit = v_mask_lane(result->hit.found, lane);
        double n[3] = {normal[0][lane], normal[1][lane], normal[2][lane]};
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        frame->depth[pixel] = hit ? t[lane] : INFINITY;
        frame->id[pixel] = hit ? shape[lane] : -1;
        frame->evals[pixel] = 1;
        if (frame->plane_count)
            frame->planes[0][pixel] = 0;
        for (int i = 0; i < 3; i++)
            frame->normal[3 * pixel + (size_t)i] = hit && length > 0 ? (float)(n[i] / length) : 0;
    }
}

// Writes the first `count` lanes to the pixels from (column, row) to the right. Misses get the exact background.
static void store_packet(const struct shaded *result, int column, int row, int count,
                         const struct scene_tables *scene, struct frame *frame) {
    float r[LANES], g[LANES], b[LANES];
    v_store_float(result->colour.x, scene->format.scale, r);
    v_store_float(result->colour.y, scene->format.scale, g);
    v_store_float(result->colour.z, scene->format.scale, b);
    size_t first = (size_t)row * (size_t)frame->width + (size_t)column;
    for (int i = 0; i < count; i++) {
        const float colour[3] = {r[i], g[i], b[i]};
        bool hit = v_mask_lane(result->hit.found, i);
        memcpy(frame->rgb + 3 * (first + (size_t)i), hit ? colour : scene->exact_background,
               sizeof colour);
    }
    if (frame->depth)
        store_aov(result, first, count, scene, frame);
}

static void render_block(struct block b, const struct scene_tables *scene, struct frame *frame,
                         int *candidates) {
    int count = find_candidates(b, scene, frame, candidates);
    if (count == 0) {
        clear_block(b, scene, frame);
        return;
    }
    const struct vec eye = vec_splat(scene->position);
    for (int row = b.row; row < b.row + b.height; row++)
        for (int done = 0; done < b.width; done += LANES) {
            int column = b.column + done, left = b.width - done;
            vnum lane = v_iota();
            vnum across = v_add(v_add(lane, lane), v_splat(2 * column + 1 - frame->width));
            vnum up = v_splat(frame->height - 1 - 2 * row);
            struct packet rays = {eye, camera_direction(across, up, scene), v_mask_first(left)};
            struct shaded result = trace(rays, scene, candidates, count);
            store_packet(&result, column, row, left < LANES ? left : LANES, scene, frame);
        }
}

void VARIANT(render_tile)(const void *data, int tile, void *candidates) {
    const struct job *job = data;
    struct frame *frame = job->frame;
    const int wide = BLOCK * TILE_BLOCKS, across = (frame->width + wide - 1) / wide;
    const int first = tile % across * wide, row = tile / across * BLOCK;
    for (int column = first; column < first + wide && column < frame->width; column += BLOCK) {
        struct block b = {column, row, frame->width - column, frame->height - row};
        b.width = b.width < BLOCK ? b.width : BLOCK;
        b.height = b.height < BLOCK ? b.height : BLOCK;
        render_block(b, job->scene, frame, candidates);
    }
}
