// Tiles of a scene of solids and planes: camera and mirror rays by closed forms, from lists of the shapes that
// a tile can see; what light a ray brings is added to its pixel, so that mirror and shadow rays can wait until
// there are enough of them to fill all lanes.
#include "hit/camera_rays.h"
#include "hit/closest_hit.h"
#include "hit/tile_frustum.h"
#include "repetition/repeated_bundles.h"
#include "simd/point.h"

// The last of the rays that wait first: what they see may make more of them.
static void follow_mirrors(const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    float (*field)[QUEUE_ROOM] = scratch->mirror;
    struct shading_packet stage[GROUP];
    while (scratch->mirrors > 0) {
        int packets = 0;
        for (; packets < GROUP && scratch->mirrors > 0; packets++) {
            int count = scratch->mirrors < LANES ? scratch->mirrors : LANES,
                first = scratch->mirrors -= count;
            struct shading_packet *at = &stage[packets];
            at->ray = (struct packet_ray){load_vec(field + M_ORIGIN, first),
                                          load_vec(field + M_DIRECTION, first),
                                          v_load(&field[M_WEIGHT][first]),
                                          v_load(&field[M_PIXEL][first]),
                                          v_load(&field[M_BOUNCE][first]),
                                          v_load(&field[M_LEAVES][first]),
                                          v_mask_first(count),
                                          {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)}};
            if (REPEATS(work->scene))
                at->ray.local = load_vec(field + M_LOCAL, first);
        }
        for (int i = 0; i < packets; i++)
            stage[i].hit = closest_mirror_hit(&stage[i].ray, work);
        if (KNOWN(work->scene)->bulbs)
            hit_bulbs(stage, packets, work);
        shade_packets(stage, packets, work);
        for (int i = 0; i < packets; i++)
            add_light(stage[i].ray.active, stage[i].color, stage[i].ray.pixel, scratch);
    }
}

// Whether a shape lies across the window, at least with its bounding sphere.
INLINE void look_across(int i, const struct window *w, const float *sides, const struct job *job,
                        struct shape_set *list) {
    const struct primitive *s = &KNOWN(job->prepared)->placed[i];
    const float *c = job->eyes[i].centre;
    if (s->way == EVAL_LINEAR) { // centre: its normal
        COUNT(shapes_in, plane);
        if (plane_in_window(w, c))
            add_to_set(list, i);
        return;
    }
    if (REPEATED(s)) { // there may be a copy anywhere
        add_to_set(list, i);
        return;
    }
    COUNT(shapes_in, solid);
    float r = s->bound * (1 + 1e-5f) + 1e-6f * (fabsf(c[0]) + fabsf(c[1]) + fabsf(c[2]));
    if (c[2] > -r && w->left * c[2] - c[0] < r * sides[0] &&
        c[0] - w->right * c[2] < r * sides[1] && w->bottom * c[2] - c[1] < r * sides[2] &&
        c[1] - w->top * c[2] < r * sides[3])
        add_to_set(list, i);
}

static void shapes_in(const struct window *w, const struct job *job, struct shape_set *list) {
    COUNT(shapes_in, call);
    float sides[4] = {sqrtf(1 + w->left * w->left), sqrtf(1 + w->right * w->right),
                      sqrtf(1 + w->bottom * w->bottom), sqrtf(1 + w->top * w->top)};
    clear_set(list);
    EACH_SHAPE(job->prepared, look_across, w, sides, job, list);
}

static inline void set_camera_ray(const struct tile *tile, struct vec direction, vmask active,
                                  int slot, struct packet_ray *ray) {
    COUNT(set_camera_ray, call);
    vfloat zero = v_splat(0.0f);
    ray->origin = tile->eye;
    ray->direction = direction;
    ray->weight = v_splat(1.0f);
    ray->pixel = v_iota() + v_splat((float)slot);
    ray->bounce = zero;
    ray->leaves = v_splat(-1.0f);
    ray->active = active;
    ray->local = (struct vec){zero, zero, zero};
}

// A camera ray and what it meets, but for Mandelbulbs and repeated shapes.
static inline void camera_packet(const struct tile *tile, struct pixel_block block, int slot,
                                 const struct job *job, const struct worker_scratch *scratch,
                                 struct shading_packet *at) {
    ACTIVE(block.across * block.down);
    COUNT(camera_packet, call);
    struct vec d = get_direction(tile, block, job->frame);
    vmask active = in_picture(block);
    set_camera_ray(tile, d, active, slot, &at->ray);
    no_hit(&at->hit);
    if (!HAS_BVH(job->prepared)) {
        EACH_IN(scratch->camera_list_count, meet, d, active, job->eyes, job->prepared, &at->hit);
        return;
    }
    int number = (block.column - tile->left) / BLOCK_WIDTH;
    const int *list = scratch->row_list + number * job->prepared->model.shape_count;
    for (int k = 0; k < scratch->row_counts[number]; k++)
        meet(list[k], d, active, job->eyes, job->prepared, &at->hit);
}

// Of a crowd: what each of the row's blocks can meet.
static inline void list_for_row(const struct tile *tile, int row, const struct job *job,
                                struct worker_scratch *scratch) {
    struct frame *frame = job->frame;
    float per = tile->per_height;
    struct window window = {
        (float)(2 * tile->left + 1 - frame->width) * per,
        (float)(2 * tile->right - 1 - frame->width) * per,
        (float)(frame->height + 1 - 2 * int_min(tile->bottom, row + BLOCK_HEIGHT)) * per,
        (float)(frame->height - 1 - 2 * row) * per};
    bvh_list_in_row(&window, 2 * BLOCK_WIDTH * per, job, scratch);
}

INLINE void is_single(int i, const struct prepared *scene, bool *some) {
    *some = *some || !REPEATED(&KNOWN(scene)->placed[i]);
}

// What a tile's packets meet where shapes are repeated: first of the others.
static void repeated_tile(const struct tile *tile, const struct job *job,
                          const struct worker_scratch *scratch, struct primary_hit *sights) {
    struct block_grid mesh;
    float per_height = tile->per_height;
    mesh.across = (tile->right - tile->left + BLOCK_WIDTH - 1) / BLOCK_WIDTH;
    mesh.down = (tile->bottom - tile->top + BLOCK_HEIGHT - 1) / BLOCK_HEIGHT;
    mesh.left = (float)(2 * tile->left - job->frame->width) * per_height;
    mesh.top = (float)(job->frame->height - 2 * tile->top) * per_height;
    mesh.pixel = 2 * per_height;
    COUNT(repeated_tile, call);
    COUNT(repeated_tile, scalar);
    bool others = false; // plain ones that are not repeated
    if (needs_no_secondary(&KNOWN(job->prepared)->model))
        EACH_SHAPE(job->prepared, is_single, job->prepared, &others);
    struct vec columns[BLOCKS_ACROSS];
    ACTIVE(LANES);
    for (int i = 0; i < mesh.across; i++)
        columns[i] = column_of(tile, tile->left + i * BLOCK_WIDTH, job->frame);
    for (int row = 0; row < mesh.down; row++) {
        ACTIVE(LANES);
        vfloat up = row_of_picture(tile, tile->top + row * BLOCK_HEIGHT, job->frame);
        for (int i = 0; i < mesh.across; i++) {
            struct primary_hit *at = &sights[row * BLOCKS_ACROSS + i];
            struct pixel_block block = block_at(tile, tile->top + row * BLOCK_HEIGHT, i);
            ACTIVE(block.across * block.down);
            COUNT(repeated_tile, packet);
            at->direction = direction_in(tile, columns[i], up);
            at->active = in_picture(block);
            at->only = -1;
            no_hit(&at->hit);
            EACH_IN(scratch->camera_list_count, meet, at->direction, at->active, job->eyes,
                    job->prepared, &at->hit);
            if (others)
                primary_normals(at, job->prepared);
        }
    }
    EACH_IN(scratch->camera_list_count, hit_repeated, &mesh, job, sights);
}

// A row of packets that nothing waits for.
static void shade_primary_row(const struct tile *tile, int row, const struct primary_hit *sights,
                              int pixel, struct frame *frame, const struct tile_context *work) {
    COUNT(shade_primary_row, call);
    sights += (row - tile->top) / BLOCK_HEIGHT * BLOCKS_ACROSS;
    bool all = frame->depth != NULL;
    for (int i = 0; tile->left + i * BLOCK_WIDTH < tile->right; i++, pixel += LANES) {
        struct shading_packet at;
        set_camera_ray(tile, sights[i].direction, sights[i].active, pixel, &at.ray);
        shade_primary_hit(&sights[i], &at, work);
        if (all) {
            struct surface_hit hit = at.hit; // a copy: `at` stays in registers
            struct vec n = sights[i].hit.local;
            vmask away = v_cmp_gt(vec_dot(n, sights[i].direction), v_splat(0.0f));
            ACTIVE(v_count(sights[i].active));
            COUNT(shade_primary_row, normal);
            store_hit(frame, block_at(tile, row, i), &hit,
                      (struct vec){v_negate_where(away, n.x), v_negate_where(away, n.y),
                                   v_negate_where(away, n.z)});
        }
        float *to = &work->scratch->color[pixel];
        v_store(at.color.x, to);
        v_store(at.color.y, to + COLOR_ROOM);
        v_store(at.color.z, to + 2 * COLOR_ROOM);
    }
}

INLINE void look_for_bulb(int shape, const struct tile *tile, const struct job *job,
                          struct worker_scratch *scratch) {
    const struct primitive *s = &KNOWN(job->prepared)->placed[shape];
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

int count_tiles(const struct job *job) {
    return (job->frame->width + TILE_WIDTH - 1) / TILE_WIDTH *
           ((job->frame->height + job->tile_height - 1) / job->tile_height);
}

static inline void set_tile_context(const struct job *job, struct worker_scratch *scratch,
                                    struct tile_context *work) {
    const struct view *view = job->view;
    *work = (struct tile_context){.scene = job->prepared, .view = view, .scratch = scratch};
    for (int k = 0; k < 3; k++) {
        work->light[k] = (float)view->light_position[k];
        work->emission[k] = (float)view->light_emission[k];
        work->light_from_eye[k] = (float)(view->light_position[k] - view->position[k]);
    }
    const double *at = view->position;
    work->inside = (float)(KNOWN(job->prepared)->model.march.bounds_radius * (1 - 0x1p-16) -
                           sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]));
}

static inline void set_tile(const struct job *job, int number, struct tile *tile) {
    const struct frame *frame = job->frame;
    const struct view *view = job->view;
    int tiles_across = (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
    int left = number % tiles_across * TILE_WIDTH, top = number / tiles_across * job->tile_height;
    vfloat below = v_floor(v_iota() * v_splat(1.0f / BLOCK_WIDTH));
    *tile = (struct tile){left,
                          int_min(frame->width, left + TILE_WIDTH),
                          top,
                          int_min(frame->height, top + job->tile_height),
                          vec_from_doubles(view->position),
                          vec_from_doubles(view->forward),
                          vec_from_doubles(view->right),
                          vec_from_doubles(view->up),
                          below,
                          v_iota() - below * v_splat(BLOCK_WIDTH),
                          (float)(view->tan_half_fov / frame->height)};
}

// To desk->listed: what the tile's camera rays may meet.
static inline void list_for_tile(const struct tile *tile, const struct job *job,
                                 struct worker_scratch *scratch) {
    const struct frame *frame = job->frame;
    struct window window = {(float)(2 * tile->left + 1 - frame->width) * tile->per_height,
                            (float)(2 * tile->right - 1 - frame->width) * tile->per_height,
                            (float)(frame->height + 1 - 2 * tile->bottom) * tile->per_height,
                            (float)(frame->height - 1 - 2 * tile->top) * tile->per_height};
    if (HAS_BVH(job->prepared))
        bvh_list_in_window(&window, job, scratch);
    else
        shapes_in(&window, job, &scratch->camera_list_count);
}

// A row's packets; how many. sights: where shapes are repeated, what they see.
static inline int camera_row(const struct tile *tile, int row, int pixel,
                             const struct primary_hit *sights, const struct job *job,
                             struct worker_scratch *scratch, struct shading_packet *stage) {
    int count = 0;
    sights += (row - tile->top) / BLOCK_HEIGHT * BLOCKS_ACROSS;
    if (HAS_BVH(job->prepared))
        list_for_row(tile, row, job, scratch);
    for (; tile->left + count * BLOCK_WIDTH < tile->right; count++, pixel += LANES) {
        struct shading_packet *at = &stage[count];
        if (REPEATS(job->prepared)) {
            const struct primary_hit *seen = &sights[count];
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
    return count;
}

static inline void store_row_colors(const struct tile *tile, int row, int pixel,
                                    const struct shading_packet *stage, int count,
                                    struct frame *frame, struct worker_scratch *scratch) {
    for (int i = 0; i < count; i++, pixel += LANES) {
        if (frame->depth)
            store_hit(frame, block_at(tile, row, i), &stage[i].hit, stage[i].surface.normal);
        float *to = &scratch->color[pixel];
        v_store(stage[i].color.x, to);
        v_store(stage[i].color.y, to + COLOR_ROOM);
        v_store(stage[i].color.z, to + 2 * COLOR_ROOM);
    }
}

static inline void store_tile(const struct tile *tile, struct frame *frame,
                              const struct worker_scratch *scratch) {
    if (is_whole_lines(tile->left, tile->right, tile->top, tile->bottom)) {
        store_rows(frame, tile->left, tile->right, tile->top, tile->bottom, scratch->color);
        return;
    }
    int pixel = 0;
    for (int row = tile->top; row < tile->bottom; row += BLOCK_HEIGHT)
        for (int i = 0; tile->left + i * BLOCK_WIDTH < tile->right; i++, pixel += LANES)
            store_colors(frame, block_at(tile, row, i), &scratch->color[pixel]);
}

void draw_analytic_tile(const struct job *job, int number, struct worker_scratch *scratch) {
    ACTIVE(LANES); // not what the tile before has left
    COUNT(draw_analytic_tile, call);
    COUNT(draw_analytic_tile, scalar);
    COUNT(draw_analytic_tile, eye);
    struct frame *frame = job->frame;
    struct tile_context work;
    set_tile_context(job, scratch, &work);
    struct tile tile;
    set_tile(job, number, &tile);
    list_for_tile(&tile, job, scratch);
    if (is_set_empty(&scratch->camera_list_count)) {
        fill_background(frame, tile.left, tile.right, tile.top, tile.bottom,
                        &KNOWN(job->prepared)->model);
        return;
    }
    if (KNOWN(job->prepared)->bulbs) {
        clear_bulb_hits(scratch, TILE_WIDTH * BULB_TILE_HEIGHT);
        EACH_IN(scratch->camera_list_count, look_for_bulb, &tile, job, scratch);
    }
    bool plain = REPEATS(job->prepared) && needs_no_secondary(&KNOWN(job->prepared)->model);
    struct primary_hit sights[BLOCKS];
    if (REPEATS(job->prepared))
        repeated_tile(&tile, job, scratch, sights);
    struct shading_packet stage[GROUP];
    int across = (tile.right - tile.left + BLOCK_WIDTH - 1) / BLOCK_WIDTH * LANES, pixel = 0;
    for (int row = tile.top; row < tile.bottom; row += BLOCK_HEIGHT, pixel += across) {
        if (plain) {
            shade_primary_row(&tile, row, sights, pixel, frame, &work);
            continue;
        }
        int count = camera_row(&tile, row, pixel, sights, job, scratch, stage);
        shade_packets(stage, count, &work);
        store_row_colors(&tile, row, pixel, stage, count, frame, scratch);
        if (scratch->mirrors > QUEUE / 2)
            follow_mirrors(&work);
    }
    follow_mirrors(&work);
    cast_shadows(&work);
    store_tile(&tile, frame, scratch);
}
