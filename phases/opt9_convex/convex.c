// Tiles of a scene of solids and planes: camera and mirror rays by closed forms, from lists of the shapes that
// a tile can see; what light a ray brings is added to its pixel, so that mirror and shadow rays can wait until
// there are enough of them to fill all lanes.
#include "cells.h"
#include "crowd.h"
#include "layers.h"
#include "picture.h"
#include "window.h"

static inline void take(mask met, real t, struct vec local, const struct placed *s,
                        struct found *hit) {
    if (!any(met))
        return;
    hit->found = either(hit->found, met);
    hit->t = choose(met, t, hit->t);
    hit->shape = choose(met, set(s->index), hit->shape);
    hit->local = vec_choose(met, local, hit->local);
}

// Camera rays. Where the camera is inside of a shape, march.c has the frame.
static void first_hit(struct vec direction, mask active, const struct eye *eyes, const int *list,
                      int count, const struct prepared *scene, struct found *hit) {
    COUNT(first_hit, call);
    real zero = set(0.0f);
    hit->found = no_lane();
    hit->t = set(INFINITY);
    hit->shape = set(-1.0f);
    hit->local = (struct vec){zero, zero, zero};
    for (int k = 0; k < count; k++) {
        int i = list[k];
        const struct placed *s = &scene->placed[i];
        real t;
        mask met;
        struct vec local;
        if (s->type == SHAPE_MANDELBULB || s->repeated) // by meet_bulbs(), meet_layers()
            continue;
        ACTIVE(count_of(active));
        if (s->way == LINEAR) {
            COUNT(first_hit, plane);
            real slope = vec_dot(vec_set(s->normal), direction);
            t = set(eyes[i].height) / (zero - slope);
            met = both(active, less(slope, zero)); // the camera is above it
            local = hit->local;
        } else {
            COUNT(first_hit, solid);
            mask behind;
            met = enter(vec_set(eyes[i].at), turned(s, direction), s, active, &t, &local, &behind);
        }
        take(both(met, less(t, hit->t)), t, local, s, hit);
    }
}

// Mirror rays start off a surface by surface_offset: in a crevice, inside of another solid. Like a march they
// then hit it at once, at the distance that they are at, which is negative.
static mask meet_from(struct vec o, struct vec d, const struct placed *s, mask active, mask own,
                      real *t, struct vec *local) {
    COUNT(meet_from, call);
    if (s->convex)
        active = but_not(own, active); // what it leaves, it does not meet again
    mask within, met = enter(o, d, s, active, t, local, &within);
    if (!s->convex) {
        COUNT(meet_from, torus);
        within = both(but_not(own, active), less(vec_dot(o, o), set(s->bound_sq)));
    }
    if (!any(within))
        return met;
    COUNT(meet_from, within);
    real h = distance_at(o, s, no_lane());
    mask inside = both(within, less(h, set(0.0f)));
    *t = choose(inside, h, *t);
    *local = vec_choose(inside, vec_along(o, d, h), *local);
    return either(met, inside);
}

static void mirror_hit(const struct ray *ray, const struct convex *work, struct found *hit) {
    COUNT(mirror_hit, call);
    const struct prepared *scene = work->scene;
    int *list = scene->tree.levels ? work->desk->mirrored : NULL, count = scene->model.shape_count;
    if (list)
        count = crowd_along(ray->origin, ray->direction, ray->active, work, list);
    real zero = set(0.0f);
    *hit = (struct found){no_lane(), set(INFINITY), set(-1.0f), {zero, zero, zero}};
    real bounds = zero;
    if (scene->repeats)
        bounds = until_bounds(ray->origin, ray->direction, &scene->model.march);
    for (int k = 0; k < count; k++) {
        int i = list ? list[k] : k;
        const struct placed *s = &scene->placed[i];
        ACTIVE(count_of(ray->active));
        mask own = same_shape(ray->leaves, i), met;
        real t;
        struct vec local = hit->local;
        if (s->type == SHAPE_MANDELBULB) // by meet_bulbs()
            continue;
        COUNT(mirror_hit, shape);
        if (s->way == LINEAR) {
            COUNT(mirror_hit, plane);
            real slope = vec_dot(vec_set(s->normal), ray->direction);
            real height = height_over(s, ray->origin);
            mask under = less(height, zero);
            t = choose(under, height, height / (zero - slope));
            met = both(but_not(own, ray->active), either(under, less(slope, zero)));
        } else if (s->repeated) {
            COUNT(mirror_hit, repeated);
            met = meet_cells(ray, s, own, least_of(bounds, hit->t),
                             (float)scene->model.march.surface_offset, &t, &local);
        } else {
            COUNT(mirror_hit, solid);
            met = meet_from(in_frame(s, ray->origin), turned(s, ray->direction), s, ray->active,
                            own, &t, &local);
        }
        take(both(met, less(t, hit->t)), t, local, s, hit);
    }
}

// The last of the rays that wait first: what they see may make more of them.
static void follow_mirrors(const struct convex *work) {
    struct desk *desk = work->desk;
    float (*field)[QUEUE_ROOM] = desk->mirror;
    struct stage stage[GROUP];
    while (desk->mirrors > 0) {
        int packets = 0;
        for (; packets < GROUP && desk->mirrors > 0; packets++) {
            int count = desk->mirrors < LANES ? desk->mirrors : LANES,
                first = desk->mirrors -= count;
            struct stage *at = &stage[packets];
            at->ray = (struct ray){load_vec(field + M_ORIGIN, first),
                                   load_vec(field + M_DIRECTION, first),
                                   load(&field[M_WEIGHT][first]),
                                   load(&field[M_PIXEL][first]),
                                   load(&field[M_BOUNCE][first]),
                                   load(&field[M_LEAVES][first]),
                                   first_lanes(count),
                                   {set(0.0f), set(0.0f), set(0.0f)}};
            if (work->scene->repeats)
                at->ray.local = load_vec(field + M_LOCAL, first);
        }
        for (int i = 0; i < packets; i++)
            mirror_hit(&stage[i].ray, work, &stage[i].hit);
        if (work->scene->bulbs)
            meet_bulbs(stage, packets, work);
        color_all(stage, packets, work);
        for (int i = 0; i < packets; i++)
            add_light(stage[i].ray.active, stage[i].color, stage[i].ray.pixel, desk);
    }
}

// The shapes that lie across it, at least with their bounding spheres.
static int shapes_in(const struct window *w, const struct job *job, int *list) {
    COUNT(shapes_in, call);
    float sides[4] = {sqrtf(1 + w->left * w->left), sqrtf(1 + w->right * w->right),
                      sqrtf(1 + w->bottom * w->bottom), sqrtf(1 + w->top * w->top)};
    int count = 0;
    for (int i = 0; i < job->prepared->model.shape_count; i++) {
        const struct placed *s = &job->prepared->placed[i];
        const float *c = job->prepared->eyes[i].centre;
        if (s->way == LINEAR) { // centre: its normal
            COUNT(shapes_in, plane);
            if (plane_in_window(w, c))
                list[count++] = i;
            continue;
        }
        if (s->repeated) { // there may be a copy anywhere
            list[count++] = i;
            continue;
        }
        COUNT(shapes_in, solid);
        float r = s->bound * (1 + 1e-5f);
        if (c[2] > -r && w->left * c[2] - c[0] < r * sides[0] &&
            c[0] - w->right * c[2] < r * sides[1] && w->bottom * c[2] - c[1] < r * sides[2] &&
            c[1] - w->top * c[2] < r * sides[3])
            list[count++] = i;
    }
    return count;
}

static int lesser(int a, int b) {
    return a < b ? a : b;
}

static inline mask in_picture(struct block block) {
    COUNT(in_picture, call);
    if (block.across == BLOCK_WIDTH && block.down == BLOCK_HEIGHT)
        return all_lanes();
    COUNT(in_picture, cut);
    real below = floor_of(lane_numbers() * set(1.0f / BLOCK_WIDTH));
    return both(less(lane_numbers() - below * set(BLOCK_WIDTH), set((float)block.across)),
                less(below, set((float)block.down)));
}

static struct vec vec_from(const double a[3]) {
    return (struct vec){set((float)a[0]), set((float)a[1]), set((float)a[2])};
}

// What the tile's blocks have in common.
struct tile {
    int left, right, top, bottom;
    struct vec eye, ahead, across, up;
    real below, beside; // of the lanes in their block, in pixels
    float per_height;
};

static inline struct block block_at(const struct tile *tile, int row, int i) {
    int column = tile->left + i * BLOCK_WIDTH;
    return (struct block){column, row, lesser(BLOCK_WIDTH, tile->right - column),
                          lesser(BLOCK_HEIGHT, tile->bottom - row)};
}

static inline struct vec get_direction(const struct tile *tile, struct block block,
                                       const struct frame *frame) {
    COUNT(get_direction, call);
    COUNT(get_direction, tile);
    real two = set(2.0f), per_height = set(tile->per_height);
    real x =
        mul_add(two, tile->beside, set((float)(2 * block.column + 1 - frame->width))) * per_height;
    real y =
        neg_mul_add(two, tile->below, set((float)(frame->height - 1 - 2 * block.row))) * per_height;
    struct vec d = vec_along(vec_along(tile->ahead, tile->across, x), tile->up, y);
    return vec_scale(d, set(1.0f) / vec_norm(d));
}

// Part by part, here and for hits: a mask that was just written, copied as a part of a whole register, is waited for.
static inline void set_camera_ray(const struct tile *tile, struct vec direction, mask active,
                                  int slot, struct ray *ray) {
    COUNT(set_camera_ray, call);
    real zero = set(0.0f);
    ray->origin = tile->eye;
    ray->direction = direction;
    ray->weight = set(1.0f);
    ray->pixel = lane_numbers() + set((float)slot);
    ray->bounce = zero;
    ray->leaves = set(-1.0f);
    ray->active = active;
    ray->local = (struct vec){zero, zero, zero};
}

// A camera ray and what it meets, but for Mandelbulbs and repeated shapes.
static inline void look(const struct tile *tile, struct block block, int slot,
                        const struct job *job, const struct desk *desk, struct stage *at) {
    ACTIVE(block.across * block.down);
    COUNT(look, call);
    struct vec d = get_direction(tile, block, job->frame);
    mask active = in_picture(block);
    set_camera_ray(tile, d, active, slot, &at->ray);
    first_hit(d, active, job->prepared->eyes, desk->list, desk->listed, job->prepared, &at->hit);
}

// What a tile's packets meet where shapes are repeated: first of the others.
static void look_through(const struct tile *tile, const struct job *job, const struct desk *desk,
                         struct sight *sights) {
    struct mesh mesh;
    float per_height = tile->per_height;
    mesh.across = (tile->right - tile->left + BLOCK_WIDTH - 1) / BLOCK_WIDTH;
    mesh.down = (tile->bottom - tile->top + BLOCK_HEIGHT - 1) / BLOCK_HEIGHT;
    mesh.left = (float)(2 * tile->left - job->frame->width) * per_height;
    mesh.top = (float)(job->frame->height - 2 * tile->top) * per_height;
    mesh.step_across = 2 * BLOCK_WIDTH * per_height;
    mesh.step_down = 2 * BLOCK_HEIGHT * per_height;
    COUNT(look_through, call);
    COUNT(look_through, scalar);
    for (int row = 0; row < mesh.down; row++)
        for (int i = 0; i < mesh.across; i++) {
            struct sight *at = &sights[row * ACROSS + i];
            struct block block = block_at(tile, tile->top + row * BLOCK_HEIGHT, i);
            ACTIVE(block.across * block.down);
            COUNT(look_through, packet);
            at->direction = get_direction(tile, block, job->frame);
            at->active = in_picture(block);
            first_hit(at->direction, at->active, job->prepared->eyes, desk->list, desk->listed,
                      job->prepared, &at->hit);
        }
    for (int k = 0; k < desk->listed; k++) {
        const struct placed *s = &job->prepared->placed[desk->list[k]];
        if (s->repeated && !s->led)
            meet_layers(desk->list[k], &mesh, job, sights);
    }
}

// The camera in a Mandelbulb's frame, in doubles: as floats, its rays would pass by what they are to meet.
struct exact_eye {
    double at[3], ahead[3], across[3], up[3];
};

static struct exact_eye exact_eye_of(const struct placed *s, const struct view *view) {
    COUNT(exact_eye_of, call);
    struct exact_eye eye = {{0}, {0}, {0}, {0}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            eye.at[i] += s->row[i][k] * (view->position[k] - s->centre[k]);
            eye.ahead[i] += s->row[i][k] * view->forward[k];
            eye.across[i] += s->row[i][k] * view->right[k];
            eye.up[i] += s->row[i][k] * view->up[k];
        }
    return eye;
}

static inline wide wide_add(wide a, double b) {
    half each = half_set(b);
    return (wide){a.low + each, a.high + each};
}

static struct wide_vec exact_look(const struct tile *tile, struct block block,
                                  const struct exact_eye *eye, const struct job *job) {
    COUNT(exact_look, call);
    COUNT(exact_look, scalar);
    double per_height = job->view->tan_half_fov / job->frame->height;
    real zero = set(0.0f), two = set(2.0f);
    real x = mul_add(two, tile->beside, set((float)(2 * block.column + 1 - job->frame->width)));
    real y = neg_mul_add(two, tile->below, set((float)(job->frame->height - 1 - 2 * block.row)));
    wide right = wide_mul(wide_sum(x, zero), per_height);
    wide above = wide_mul(wide_sum(y, zero), per_height);
    wide d[3];
    half low = half_set(0.0), high = low;
    for (int i = 0; i < 3; i++) {
        d[i] = wide_add(wide_mul_add(right, eye->across[i], wide_mul(above, eye->up[i])),
                        eye->ahead[i]);
        low = half_mul_add(d[i].low, d[i].low, low);
        high = half_mul_add(d[i].high, d[i].high, high);
    }
    low = half_set(1.0) / half_root(low);
    high = half_set(1.0) / half_root(high);
    for (int i = 0; i < 3; i++)
        d[i] = (wide){d[i].low * low, d[i].high * high};
    return (struct wide_vec){d[0], d[1], d[2]};
}

static inline wide wide_set(double a) {
    return (wide){half_set(a), half_set(a)};
}

static void look_for_bulbs(const struct tile *tile, const struct job *job, struct desk *desk) {
    clear_met(desk, TILE_WIDTH * BULB_TILE_HEIGHT);
    for (int k = 0; k < desk->listed; k++) {
        const struct placed *s = &job->prepared->placed[desk->list[k]];
        if (s->type != SHAPE_MANDELBULB)
            continue;
        struct exact_eye eye = exact_eye_of(s, job->view);
        struct wide_vec o = {wide_set(eye.at[0]), wide_set(eye.at[1]), wide_set(eye.at[2])};
        int count = 0, slot = 0;
        for (int row = tile->top; row < tile->bottom; row += BLOCK_HEIGHT)
            for (int i = 0; tile->left + i * BLOCK_WIDTH < tile->right; i++, slot += LANES) {
                struct stage at;
                struct block block = block_at(tile, row, i);
                look(tile, block, slot, job, desk, &at);
                count = gather_bulb(count, s, o, exact_look(tile, block, &eye, job), &at.ray,
                                    at.hit.t, slot, job->prepared, desk);
            }
        march_bulb(s, count, &job->prepared->model.march, desk);
    }
}

void convex_tile(const struct job *job, int number, struct desk *desk) {
    struct frame *frame = job->frame;
    const struct view *view = job->view;
    struct convex work = {.scene = job->prepared, .view = view, .desk = desk};
    for (int k = 0; k < 3; k++) {
        work.light[k] = (float)view->light_position[k];
        work.emission[k] = (float)view->light_emission[k];
    }
    int tiles_across = (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
    COUNT(convex_tile, call);
    COUNT(convex_tile, scalar);
    int left = number % tiles_across * TILE_WIDTH, top = number / tiles_across * job->tile_height;
    real below = floor_of(lane_numbers() * set(1.0f / BLOCK_WIDTH));
    struct tile tile = {left,
                        lesser(frame->width, left + TILE_WIDTH),
                        top,
                        lesser(frame->height, top + job->tile_height),
                        vec_from(view->position),
                        vec_from(view->forward),
                        vec_from(view->right),
                        vec_from(view->up),
                        below,
                        lane_numbers() - below * set(BLOCK_WIDTH),
                        (float)(view->tan_half_fov / frame->height)};
    struct window window = {(float)(2 * tile.left + 1 - frame->width) * tile.per_height,
                            (float)(2 * tile.right - 1 - frame->width) * tile.per_height,
                            (float)(frame->height + 1 - 2 * tile.bottom) * tile.per_height,
                            (float)(frame->height - 1 - 2 * tile.top) * tile.per_height};
    desk->listed = job->prepared->tree.levels ? crowd_in_window(&window, job, desk, desk->list)
                                              : shapes_in(&window, job, desk->list);
    if (desk->listed == 0) {
        fill_background(frame, tile.left, tile.right, tile.top, tile.bottom, &job->prepared->model);
        return;
    }
    if (job->prepared->bulbs)
        look_for_bulbs(&tile, job, desk);
    struct sight sights[BLOCKS];
    if (job->prepared->repeats)
        look_through(&tile, job, desk, sights);
    struct stage stage[GROUP];
    int pixel = 0;
    for (int row = tile.top; row < tile.bottom; row += BLOCK_HEIGHT) {
        int count = 0;
        for (; tile.left + count * BLOCK_WIDTH < tile.right; count++) {
            struct stage *at = &stage[count];
            if (job->prepared->repeats) {
                const struct sight *seen =
                    &sights[(row - tile.top) / BLOCK_HEIGHT * ACROSS + count];
                set_camera_ray(&tile, seen->direction, seen->active, pixel + count * LANES,
                               &at->ray);
                at->hit.found = seen->hit.found;
                at->hit.t = seen->hit.t;
                at->hit.shape = seen->hit.shape;
                at->hit.local = seen->hit.local;
                continue;
            }
            look(&tile, block_at(&tile, row, count), pixel + count * LANES, job, desk, at);
            if (job->prepared->bulbs)
                take_bulb(at, pixel + count * LANES, desk);
        }
        color_all(stage, count, &work);
        for (int i = 0; i < count; i++, pixel += LANES) {
            if (frame->depth)
                store_hit(frame, block_at(&tile, row, i), &stage[i].hit, stage[i].surface.normal);
            float *to = &desk->color[pixel];
            unload(stage[i].color.x, to);
            unload(stage[i].color.y, to + COLOR_ROOM);
            unload(stage[i].color.z, to + 2 * COLOR_ROOM);
        }
        if (desk->mirrors > QUEUE / 2)
            follow_mirrors(&work);
    }
    follow_mirrors(&work);
    cast_shadows(&work);
#if LANES == 16
    if (whole_lines(tile.left, tile.right, tile.top, tile.bottom)) {
        store_lines(frame, tile.left, tile.right, tile.top, tile.bottom, desk->color);
        return;
    }
#endif
    pixel = 0;
    for (int row = tile.top; row < tile.bottom; row += BLOCK_HEIGHT)
        for (int i = 0; tile.left + i * BLOCK_WIDTH < tile.right; i++, pixel += LANES)
            store_colors(frame, block_at(&tile, row, i), &desk->color[pixel]);
}
