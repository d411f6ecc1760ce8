// A tile by closed forms. Camera and mirror rays are intersected with the shapes that the tile can see.
// Mirror and shadow rays wait in queues until they fill all lanes; each adds its light to its pixel.
#include "bulb/bulb_march.h"
#include "bvh/bvh_lists.h"
#include "frame/tile.h"
#include "hit/sharp.h"
#include "hit/solids.h"
#include "hit/tile_frustum.h"
#include "phase.h"
#include "repetition/repeated_rays.h"
#include "shadow/shadow_rays.h"
#include "types/sdf.h"

// Returns which mirror rays hit the solid s; o, d: the rays in its frame; self: rays that start on s. A
// mirror ray starts surface_offset off its surface, in a crevice inside another solid. Like a march it then
// hits that solid at once, at its negative distance.
INLINE vmask hit_from_surface(struct vec o, struct vec d, const struct primitive *s, vmask active,
                              vmask self, vfloat *t, struct vec *local) {
    if (s->convex)
        active = v_andnot(self, active); // a ray cannot hit the convex solid that it leaves
    vmask within, met = enter(o, d, s, active, t, local, &within);
    if (!s->convex)
        within = v_and(v_andnot(self, active), v_cmp_lt(vec_dot(o, o), v_splat(s->bound_sq)));
    if (!v_any(within))
        return met;
    vfloat h = distance_at(o, s, v_mask_none());
    vmask inside = v_and(within, v_cmp_lt(h, v_splat(0.0f)));
    *t = v_select(inside, h, *t);
    *local = vec_select(inside, vec_along(o, d, h), *local);
    return v_or(met, inside);
}

// Intersects mirror rays with shape i.
INLINE void mirror_hit(int i, const struct packet_ray *ray, const struct prepared *scene,
                       struct surface_hit *hit) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    vmask self = is_shape(ray->leaves, i), met;
    vfloat t;
    struct vec local = hit->local;
    if (s->type == SHAPE_MANDELBULB) // left to hit_bulbs()
        return;
    if (s->eval == EVAL_LINEAR) {
        vfloat slope = add_dot(s->normal, ray->direction), height = height_over(s, ray->origin);
        vmask under = v_cmp_lt(height, v_splat(0.0f));
        t = v_select(under, height, height / (v_splat(0.0f) - slope));
        met = v_and(v_andnot(self, ray->active), v_or(under, v_cmp_lt(slope, v_splat(0.0f))));
    } else if (REPEATED(s)) {
        vfloat end =
            v_min(bounds_distance(ray->origin, ray->direction, &scene->model.march), hit->t);
        met = hit_cells(ray, s, self, end, (float)scene->model.march.surface_offset, &t, &local);
    } else {
        met = hit_from_surface(to_local(s, ray->origin), turned(s, ray->direction), s, ray->active,
                               self, &t, &local);
    }
    take_hit(v_and(met, v_cmp_lt(t, hit->t)), t, local, s, hit);
}

// Returns the nearest hits of a packet of mirror rays, except on Mandelbulbs.
static struct surface_hit closest_mirror_hit(const struct packet_ray *ray,
                                             const struct tile_context *work) {
    struct surface_hit hit;
    no_hit(&hit);
    if (HAS_BVH(work->scene)) {
        int *list = work->scratch->mirror_list;
        int count = bvh_list_along(ray->origin, ray->direction, ray->active, work, list);
        for (int k = 0; k < count; k++)
            mirror_hit(list[k], ray, work->scene, &hit);
    } else {
        UNROLL_SHAPES
        for (int i = 0; i < KNOWN(work->scene)->model.shape_count; i++)
            mirror_hit(i, ray, work->scene, &hit);
    }
    return hit;
}

// Empties the queue of mirror rays, from its end: the hits may queue more of them.
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

// Returns whether the frustum may meet a part of the group.
static bool parts_in_frustum(const struct sharp *sharp, const struct tile_frustum *w,
                             const float *sides, const struct view *view) {
    for (int i = 0; sharp && i < sharp->balls; i++) {
        float c[3] = {0, 0, 0};
        for (int k = 0; k < 3; k++) {
            double off = (double)sharp->ball[i][k] - view->position[k];
            c[0] += (float)(view->right[k] * off);
            c[1] += (float)(view->up[k] * off);
            c[2] += (float)(view->forward[k] * off);
        }
        if (ball_in_frustum(w, sides, c, sharp->ball[i][3]))
            return true;
    }
    return !sharp || sharp->balls == 0;
}

// Adds shape i to the list if its bounding sphere meets the tile's frustum, and one of its balls if it has such; planes by
// a bound, repeated shapes always.
INLINE void add_if_in_frustum(int i, const struct tile_frustum *w, const float *sides,
                              const struct job *job, struct shape_set *list) {
    const struct primitive *s = &KNOWN(job->prepared)->primitives[i];
    const float *c = job->cameras[i].centre;
    if (s->eval == EVAL_LINEAR) { // c: its normal
        if (plane_in_frustum(w, c))
            add_to_set(list, i);
        return;
    }
    if (REPEATED(s)) { // a copy may be anywhere
        add_to_set(list, i);
        return;
    }
    if (ball_in_frustum(w, sides, c, s->bound)) {
        if (HAS_BALLS(s)) {
            struct vec axes[3] = {turned(s, vec_from_doubles(job->view->right)),
                                  turned(s, vec_from_doubles(job->view->up)),
                                  turned(s, vec_from_doubles(job->view->forward))};
            const float edges[4] = {w->left, w->right, w->bottom, w->top};
            if (!field_in_frustum(FIELD_OF(s), axes, c, edges, sides))
                return;
        }
        if (!IS_GROUP(s) || parts_in_frustum(SHARP_OF(s), w, sides, job->view))
            add_to_set(list, i);
    }
}

static void shapes_in(const struct tile_frustum *w, const struct job *job, struct shape_set *list) {
    float sides[4] = {sqrtf(1 + w->left * w->left), sqrtf(1 + w->right * w->right),
                      sqrtf(1 + w->bottom * w->bottom), sqrtf(1 + w->top * w->top)};
    clear_set(list);
    UNROLL_SHAPES
    for (int i = 0; i < KNOWN(job->prepared)->model.shape_count; i++)
        add_if_in_frustum(i, w, sides, job, list);
}

// Shades and stores a row of packets in a scene without secondary rays.
static void shade_primary_row(const struct tile *tile, int row, const struct primary_hit *hits,
                              int pixel, struct frame *frame, const struct tile_context *work) {
    hits += (row - tile->top) / BLOCK_HEIGHT * BLOCKS_ACROSS;
    bool all = frame->depth != NULL;
    for (int i = 0; tile->left + i * BLOCK_WIDTH < tile->right; i++, pixel += LANES) {
        struct shading_packet at;
        set_camera_ray(tile, hits[i].direction, hits[i].active, pixel, &at.ray);
        shade_primary_hit(&hits[i], &at, work);
        if (all) {
            struct surface_hit hit = at.hit; // a copy, so that `at` stays in registers
            struct vec n = hits[i].hit.local;
            vmask away = v_cmp_gt(vec_dot(n, hits[i].direction), v_splat(0.0f));
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

// Sets scratch->camera_shapes: the shapes that the tile's camera rays may hit.
static inline void list_for_tile(const struct tile *tile, const struct job *job,
                                 struct worker_scratch *scratch) {
    const struct frame *frame = job->frame;
    struct tile_frustum frustum = {(float)(2 * tile->left + 1 - frame->width) * tile->per_height,
                                   (float)(2 * tile->right - 1 - frame->width) * tile->per_height,
                                   (float)(frame->height + 1 - 2 * tile->bottom) * tile->per_height,
                                   (float)(frame->height - 1 - 2 * tile->top) * tile->per_height};
    if (HAS_BVH(job->prepared))
        bvh_list_in_frustum(&frustum, job, scratch);
    else
        shapes_in(&frustum, job, &scratch->camera_shapes);
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
    struct frame *frame = job->frame;
    struct tile_context work;
    set_tile_context(job, scratch, &work);
    struct tile tile;
    set_tile(job, number, &tile);
    list_for_tile(&tile, job, scratch);
    if (is_set_empty(&scratch->camera_shapes)) {
        fill_background(frame, tile.left, tile.right, tile.top, tile.bottom,
                        &KNOWN(job->prepared)->model);
        return;
    }
    if (KNOWN(job->prepared)->bulbs)
        march_tile_bulbs(&tile, job, scratch);
    bool plain = REPEATS(job->prepared) && needs_no_secondary(&KNOWN(job->prepared)->model);
    struct primary_hit hits[BLOCKS];
    if (REPEATS(job->prepared))
        repeated_tile(&tile, job, scratch, hits);
    struct shading_packet stage[GROUP];
    int across = (tile.right - tile.left + BLOCK_WIDTH - 1) / BLOCK_WIDTH * LANES, pixel = 0;
    for (int row = tile.top; row < tile.bottom; row += BLOCK_HEIGHT, pixel += across) {
        if (plain) {
            shade_primary_row(&tile, row, hits, pixel, frame, &work);
            continue;
        }
        int count = camera_row(&tile, row, pixel, hits, job, scratch, stage);
        shade_packets(stage, count, &work);
        store_row_colors(&tile, row, pixel, stage, count, frame, scratch);
        if (scratch->mirrors > QUEUE / 2)
            follow_mirrors(&work);
    }
    follow_mirrors(&work);
    cast_shadows(&work);
    store_tile(&tile, frame, scratch);
}
