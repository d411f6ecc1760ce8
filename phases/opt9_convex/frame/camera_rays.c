// The camera rays of a tile and their hits, by closed forms.
#include "bulb/bulb_march.h"
#include "bvh/bvh_lists.h"
#include "frame/tile.h"
#include "hit/solids.h"
#include "hit/tile_frustum.h"
#include "phase.h"
#include "repetition/repeated_rays.h"
#include "simd/simd.h"
#include "types/sdf.h"

static inline vmask in_picture(struct pixel_block block) {
    if (block.across == BLOCK_WIDTH && block.down == BLOCK_HEIGHT)
        return v_mask_all();
    vfloat below = v_floor(v_iota() * v_splat(1.0f / BLOCK_WIDTH));
    return v_and(v_cmp_lt(v_iota() - below * v_splat(BLOCK_WIDTH), v_splat((float)block.across)),
                 v_cmp_lt(below, v_splat((float)block.down)));
}

// Returns the part of a block's directions that depends on the column only; not of unit length.
static inline struct vec column_of(const struct tile *tile, int column, const struct frame *frame) {
    vfloat x =
        v_madd(v_splat(2.0f), tile->beside, v_splat((float)(2 * column + 1 - frame->width))) *
        v_splat(tile->per_height);
    return vec_along(tile->ahead, tile->across, x);
}

static inline vfloat row_of_picture(const struct tile *tile, int row, const struct frame *frame) {
    return v_nmadd(v_splat(2.0f), tile->below, v_splat((float)(frame->height - 1 - 2 * row))) *
           v_splat(tile->per_height);
}

static inline struct vec direction_in(const struct tile *tile, struct vec column, vfloat row) {
    struct vec d = vec_along(column, tile->up, row);
    return vec_scale(d, v_splat(1.0f) / vec_norm(d));
}

static inline struct vec get_direction(const struct tile *tile, struct pixel_block block,
                                       const struct frame *frame) {
    return direction_in(tile, column_of(tile, block.column, frame),
                        row_of_picture(tile, block.row, frame));
}

// The camera in a Mandelbulb's frame, in doubles: in floats its rays would miss the details that they should
// hit.
struct camera_double {
    double at[3], ahead[3], across[3], up[3];
};

static struct camera_double exact_eye_of(const struct primitive *s, const struct view *view) {
    struct camera_double eye = {{0}, {0}, {0}, {0}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            eye.at[i] += s->row[i][k] * (view->position[k] - s->centre[k]);
            eye.ahead[i] += s->row[i][k] * view->forward[k];
            eye.across[i] += s->row[i][k] * view->right[k];
            eye.up[i] += s->row[i][k] * view->up[k];
        }
    return eye;
}

static struct vec_double exact_look(const struct tile *tile, struct pixel_block block,
                                    const struct camera_double *eye, const struct job *job) {
    double per_height = job->view->tan_half_fov / job->frame->height;
    vfloat zero = v_splat(0.0f), two = v_splat(2.0f);
    vfloat x =
        v_madd(two, tile->beside, v_splat((float)(2 * block.column + 1 - job->frame->width)));
    vfloat y = v_nmadd(two, tile->below, v_splat((float)(job->frame->height - 1 - 2 * block.row)));
    vdouble right = v_double_mul(v_double_sum(x, zero), per_height);
    vdouble above = v_double_mul(v_double_sum(y, zero), per_height);
    return v_double_look(right, above, eye->ahead, eye->across, eye->up);
}

static inline vdouble v_double_splat(double a) {
    return (vdouble){v_half_splat(a), v_half_splat(a)};
}

// Intersects camera rays with shape i. Precondition: the camera is outside it (else fallback/march.c draws
// the frame).
INLINE void camera_hit(int i, struct vec direction, vmask active,
                       const struct local_camera *cameras, const struct prepared *scene,
                       struct surface_hit *hit) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    vfloat t;
    vmask met;
    struct vec local;
    if (s->type == SHAPE_MANDELBULB || REPEATED(s) || HAS_BALLS(s)) // see camera_row()
        return;
    if (s->eval == EVAL_LINEAR) {
        vfloat slope = add_dot(s->normal, direction);
        t = v_splat(cameras[i].height) / (v_splat(0.0f) - slope);
        met = v_and(active, v_cmp_lt(slope, v_splat(0.0f))); // the camera is above the plane
        local = hit->local;
    } else {
        vmask behind;
        met = enter(vec_set(cameras[i].at), turned(s, direction), s, active, &t, &local, &behind);
    }
    take_hit(v_and(met, v_cmp_lt(t, hit->t)), t, local, s, hit);
}

// Intersects a row of packets with a group that has balls.
INLINE void hit_balls(int i, struct shading_packet *stage, int count, const struct job *job) {
    const struct primitive *s = &KNOWN(job->prepared)->primitives[i];
    if (!HAS_BALLS(s))
        return;
    struct field_rays rays[GROUP];
    for (int k = 0; k < count; k++) {
        rays[k].d = turned(s, stage[k].ray.direction);
        rays[k].active = stage[k].ray.active;
    }
    field_row(FIELD_OF(s), vec_set(job->cameras[i].at), rays, count);
    for (int k = 0; k < count; k++)
        take_hit(v_and(rays[k].met, v_cmp_lt(rays[k].t, stage[k].hit.t)), rays[k].t, rays[k].point,
                 s, &stage[k].hit);
}

// Sets a packet of camera rays and its hits, except on Mandelbulbs and repeated shapes.
INLINE void camera_packet(const struct tile *tile, struct pixel_block block, int slot,
                          const struct job *job, const struct worker_scratch *scratch,
                          struct shading_packet *at) {
    struct vec d = get_direction(tile, block, job->frame);
    vmask active = in_picture(block);
    set_camera_ray(tile, d, active, slot, &at->ray);
    no_hit(&at->hit);
    if (!HAS_BVH(job->prepared)) {
        UNROLL_SHAPES
        for (int k = 0; k < set_end(&scratch->camera_shapes); k++)
            if (set_has(&scratch->camera_shapes, k))
                camera_hit(set_shape(&scratch->camera_shapes, k), d, active, job->cameras,
                           job->prepared, &at->hit);
        return;
    }
    int number = (block.column - tile->left) / BLOCK_WIDTH;
    const int *list = scratch->row_list + number * job->prepared->model.shape_count;
    for (int k = 0; k < scratch->row_counts[number]; k++)
        camera_hit(list[k], d, active, job->cameras, job->prepared, &at->hit);
}

// With a BVH: lists the shapes that each block of the row can hit.
static inline void list_for_row(const struct tile *tile, int row, const struct job *job,
                                struct worker_scratch *scratch) {
    struct frame *frame = job->frame;
    float per = tile->per_height;
    struct tile_frustum frustum = {
        (float)(2 * tile->left + 1 - frame->width) * per,
        (float)(2 * tile->right - 1 - frame->width) * per,
        (float)(frame->height + 1 - 2 * int_min(tile->bottom, row + BLOCK_HEIGHT)) * per,
        (float)(frame->height - 1 - 2 * row) * per};
    bvh_list_in_row(&frustum, 2 * BLOCK_WIDTH * per, job, scratch);
}

INLINE void is_single(int i, const struct prepared *scene, bool *some) {
    *some = *some || !REPEATED(&KNOWN(scene)->primitives[i]);
}

// Sets the hits of all packets of a tile in a scene with repeated shapes; the other shapes come first.
KERNEL_SHARED void repeated_tile(const struct tile *tile, const struct job *job,
                                 const struct worker_scratch *scratch, struct primary_hit *hits) {
    struct block_grid blocks;
    float per_height = tile->per_height;
    blocks.across = (tile->right - tile->left + BLOCK_WIDTH - 1) / BLOCK_WIDTH;
    blocks.down = (tile->bottom - tile->top + BLOCK_HEIGHT - 1) / BLOCK_HEIGHT;
    blocks.left = (float)(2 * tile->left - job->frame->width) * per_height;
    blocks.top = (float)(job->frame->height - 2 * tile->top) * per_height;
    blocks.pixel = 2 * per_height;
    bool others = false; // shapes that are not repeated, in a scene without secondary rays
    if (needs_no_secondary(&KNOWN(job->prepared)->model)) {
        UNROLL_SHAPES
        for (int i = 0; i < KNOWN(job->prepared)->model.shape_count; i++)
            is_single(i, job->prepared, &others);
    }
    struct vec columns[BLOCKS_ACROSS];
    for (int i = 0; i < blocks.across; i++)
        columns[i] = column_of(tile, tile->left + i * BLOCK_WIDTH, job->frame);
    for (int row = 0; row < blocks.down; row++) {
        vfloat up = row_of_picture(tile, tile->top + row * BLOCK_HEIGHT, job->frame);
        for (int i = 0; i < blocks.across; i++) {
            struct primary_hit *at = &hits[row * BLOCKS_ACROSS + i];
            struct pixel_block block = block_at(tile, tile->top + row * BLOCK_HEIGHT, i);
            at->direction = direction_in(tile, columns[i], up);
            at->active = in_picture(block);
            at->only = -1;
            no_hit(&at->hit);
            UNROLL_SHAPES
            for (int k = 0; k < set_end(&scratch->camera_shapes); k++)
                if (set_has(&scratch->camera_shapes, k))
                    camera_hit(set_shape(&scratch->camera_shapes, k), at->direction, at->active,
                               job->cameras, job->prepared, &at->hit);
            if (others)
                primary_normals(at, job->prepared);
        }
    }
    UNROLL_SHAPES
    for (int k = 0; k < set_end(&scratch->camera_shapes); k++)
        if (set_has(&scratch->camera_shapes, k))
            hit_repeated(set_shape(&scratch->camera_shapes, k), &blocks, job, hits);
}

INLINE void march_tile_bulb(int shape, const struct tile *tile, const struct job *job,
                            struct worker_scratch *scratch) {
    const struct primitive *s = &KNOWN(job->prepared)->primitives[shape];
    if (s->type != SHAPE_MANDELBULB)
        return;
    struct camera_double eye = exact_eye_of(s, job->view);
    struct vec_double o = {v_double_splat(eye.at[0]), v_double_splat(eye.at[1]),
                           v_double_splat(eye.at[2])};
    int count = 0, slot = 0;
    for (int row = tile->top; row < tile->bottom; row += BLOCK_HEIGHT)
        for (int i = 0; tile->left + i * BLOCK_WIDTH < tile->right; i++, slot += LANES) {
            struct shading_packet at;
            struct pixel_block block = block_at(tile, row, i);
            camera_packet(tile, block, slot, job, scratch, &at);
            count = queue_bulb_rays(count, s, o, exact_look(tile, block, &eye, job), &at.ray,
                                    at.hit.t, slot, job->prepared, scratch);
        }
    march_bulb(s, count, &job->prepared->model.march, scratch);
}

void march_tile_bulbs(const struct tile *tile, const struct job *job,
                      struct worker_scratch *scratch) {
    clear_bulb_hits(scratch, TILE_WIDTH * BULB_TILE_HEIGHT);
    UNROLL_SHAPES
    for (int k = 0; k < set_end(&scratch->camera_shapes); k++)
        if (set_has(&scratch->camera_shapes, k))
            march_tile_bulb(set_shape(&scratch->camera_shapes, k), tile, job, scratch);
}

// Sets up a row of packets with their hits. Returns their number. hits: from repeated_tile().
KERNEL_SHARED int camera_row(const struct tile *tile, int row, int pixel,
                             const struct primary_hit *hits, const struct job *job,
                             struct worker_scratch *scratch, struct shading_packet *stage) {
    int count = 0;
    hits += (row - tile->top) / BLOCK_HEIGHT * BLOCKS_ACROSS;
    if (HAS_BVH(job->prepared))
        list_for_row(tile, row, job, scratch);
    for (; tile->left + count * BLOCK_WIDTH < tile->right; count++, pixel += LANES) {
        struct shading_packet *at = &stage[count];
        if (REPEATS(job->prepared)) {
            const struct primary_hit *seen = &hits[count];
            set_camera_ray(tile, seen->direction, seen->active, pixel, &at->ray);
            at->hit.found = seen->hit.found;
            at->hit.t = seen->hit.t;
            at->hit.shape = seen->hit.shape;
            at->hit.local = seen->hit.local;
            continue;
        }
        camera_packet(tile, block_at(tile, row, count), pixel, job, scratch, at);
        if (KNOWN(job->prepared)->bulbs)
            take_bulb_hits(at, pixel, scratch);
    }
    if (!HAS_BVH(job->prepared)) {
        UNROLL_SHAPES
        for (int k = 0; k < set_end(&scratch->camera_shapes); k++)
            if (set_has(&scratch->camera_shapes, k))
                hit_balls(set_shape(&scratch->camera_shapes, k), stage, count, job);
    }
    return count;
}
