// Tiles of a scene of solids and planes: camera and mirror rays by closed forms, from lists of the shapes that
// a tile can see; what light a ray brings is added to its pixel, so that mirror and shadow rays can wait until
// there are enough of them to fill all lanes.
#include "bulb.h"
#include "convex.h"

struct found {
    mask found;
    real t, shape;
    struct vec local; // in the shape's frame; not for planes
};

// `eyes`: the origin is the camera, known in each shape's frame; NULL: it is `origin`.
static void first_hit(struct vec origin, struct vec direction, mask active, const struct eye *eyes,
                             const int *list, int count, const struct prepared *scene,
                             struct found *hit) {
    real zero = set(0.0f);
    *hit = (struct found){no_lane(), set(INFINITY), set(-1.0f), {zero, zero, zero}};
    for (int k = 0; k < count; k++) {
        int i = list ? list[k] : k;
        const struct placed *s = &scene->placed[i];
        real t;
        mask met;
        struct vec local;
        if (s->type == SHAPE_MANDELBULB) // by meet_bulbs()
            continue;
        if (s->way == LINEAR) {
            real slope = vec_dot(vec_set(s->normal), direction);
            real height = eyes ? set(eyes[i].height) : height_over(s, origin);
            t = height / (zero - slope);
            met = both(both(active, less(slope, zero)), greater(height, zero));
            local = hit->local;
        } else
            met = enter(eyes ? vec_set(eyes[i].at) : in_frame(s, origin), turned(s, direction), s,
                        active, &t, &local);
        met = both(met, less(t, hit->t));
        if (!any(met))
            continue;
        hit->found = either(hit->found, met);
        hit->t = choose(met, t, hit->t);
        hit->shape = choose(met, set(s->index), hit->shape);
        hit->local = vec_choose(met, local, hit->local);
    }
}

// Forward differences of the estimate, the only normal it has.
static struct vec bulb_normal(struct vec p, mask found, const struct placed *s, float step) {
    mask done = not_in(found);
    struct vec px = p, py = p, pz = p;
    px.x = px.x + set(step);
    py.y = py.y + set(step);
    pz.z = pz.z + set(step);
    real f = sdf_mandelbulb(p, s, done), fx = sdf_mandelbulb(px, s, done);
    real fy = sdf_mandelbulb(py, s, done), fz = sdf_mandelbulb(pz, s, done);
    struct vec n = {fx - f, fy - f, fz - f};
    return vec_scale(n, set(1.0f) / most_of(vec_norm(n), set(1e-30f)));
}

struct surface {
    struct vec normal, color;
    real share, shininess, shine_from;
};

// Once for each shape that the packet hit.
static struct surface surface_at(const struct found *hit, struct vec direction,
                                        const struct prepared *scene) {
    float id[LANES];
    unload(hit->shape, id);
    struct surface all;
    unsigned rest = bits(hit->found);
    for (bool first = true; rest; first = false) {
        int i = (int)id[__builtin_ctz(rest)];
        const struct placed *s = &scene->placed[i];
        mask same = both(hit->found, same_shape(hit->shape, i));
        rest &= ~bits(same);
        struct vec normal = vec_set(s->normal);
        if (s->type == SHAPE_MANDELBULB)
            normal = turned_back(s, bulb_normal(hit->local, same, s, (float)scene->model.march.normal_step));
        else if (s->way != LINEAR)
            normal = turned_back(s, normal_on(hit->local, s));
        struct surface one = {normal, vec_set(s->color), set(s->share), set(s->shininess), set(s->shine_from)};
        if (first) {
            all = one;
            continue;
        }
        all.normal = vec_choose(same, one.normal, all.normal);
        all.color = vec_choose(same, one.color, all.color);
        all.share = choose(same, one.share, all.share);
        all.shininess = choose(same, one.shininess, all.shininess);
        all.shine_from = choose(same, one.shine_from, all.shine_from);
    }
    mask away = greater(vec_dot(all.normal, direction), set(0.0f));
    all.normal = (struct vec){negate_where(away, all.normal.x), negate_where(away, all.normal.y),
                              negate_where(away, all.normal.z)};
    return all;
}

struct ray {
    struct vec origin, direction;
    real weight, pixel, bounce;
    mask active;
};

static void queue_shadow(mask m, struct vec p, const struct found *hit, struct vec to_light, real facing, struct vec light,
                         real pixel, const struct convex *work) {
    struct desk *desk = work->desk;
    if (desk->shadows > QUEUE - LANES)
        cast_shadows(work);
    int at = desk->shadows;
    float(*field)[QUEUE_ROOM] = desk->shadow;
    pack_vec(m, p, field + S_POINT, at);
    pack_vec(m, hit->local, field + S_LOCAL, at);
    pack_vec(m, to_light, field + S_TO_LIGHT, at);
    pack_vec(m, light, field + S_LIGHT, at);
    pack(m, facing, &field[S_FACING][at]);
    pack(m, hit->shape, &field[S_SHAPE][at]);
    pack(m, pixel, &field[S_PIXEL][at]);
    desk->shadows += count_of(m);
}

static void queue_mirror(mask m, const struct ray *ray, struct vec p, struct vec n, real weight, const struct convex *work) {
    struct desk *desk = work->desk;
    int at = desk->mirrors;
    float(*field)[QUEUE_ROOM] = desk->mirror;
    float offset = (float)work->scene->model.march.surface_offset;
    pack_vec(m, vec_along(p, n, set(offset)), field + M_ORIGIN, at);
    pack_vec(m, vec_reflect(ray->direction, n), field + M_DIRECTION, at);
    pack(m, weight, &field[M_WEIGHT][at]);
    pack(m, ray->pixel, &field[M_PIXEL][at]);
    pack(m, ray->bounce + set(1.0f), &field[M_BOUNCE][at]);
    desk->mirrors += count_of(m);
}

static struct vec grazed(struct vec light, mask grazes, const struct found *hit, struct vec to_light, real facing,
                         const struct prepared *scene) {
    float id[LANES];
    unload(hit->shape, id);
    for (unsigned rest = bits(grazes); rest;) {
        int i = (int)id[__builtin_ctz(rest)];
        mask same = both(grazes, same_shape(hit->shape, i));
        rest &= ~bits(same);
        real lit = own_shadow(&scene->placed[i], hit->local, to_light, facing, &scene->model);
        light = vec_choose(same, vec_scale(light, lit), light);
    }
    return light;
}

static inline struct vec background(real weight, const struct model *model) {
    const double *b = model->background;
    return (struct vec){weight * set((float)b[0]), weight * set((float)b[1]), weight * set((float)b[2])};
}

static inline mask in_bounds(struct vec p, const struct model *model) {
    float radius = (float)model->march.bounds_radius;
    return not_less(set(radius * radius), vec_dot(p, p));
}

// A packet of rays on its way to a colour. A group of them takes each step together: each packet's steps wait
// for each other, those of different packets do not.
struct stage {
    struct ray ray;
    struct found hit;
    struct vec point, color, to_light, light;
    struct surface surface;
    real weight, facing;
    mask lit, open;
};

static inline void stage_surface(struct stage *at, const struct prepared *scene) {
    struct ray *ray = &at->ray;
    at->point = vec_along(ray->origin, ray->direction, at->hit.t);
    at->hit.found = both(at->hit.found, in_bounds(at->point, &scene->model));
    if (any(at->hit.found))
        at->surface = surface_at(&at->hit, ray->direction, scene);
}

static inline void stage_light(struct stage *at, const struct view *view, const struct model *model) {
    const struct ray *ray = &at->ray;
    const struct surface *surface = &at->surface;
    struct vec p = at->point, n = surface->normal, base = surface->color;
    real weight = ray->weight, zero = set(0.0f);
    if (model->features.fog) {
        real far_sq = vec_dot(p, p);
        weight = weight * exp_of(set((float)-model->fog) * far_sq * root(far_sq));
    }
    at->weight = weight;
    at->color = vec_choose(at->hit.found, vec_scale(base, weight * set(0.01f)), background(ray->weight, model)); // ambient
    const double *light = view->light_position, *e = view->light_emission;
    struct vec l = {set((float)light[0]) - p.x, set((float)light[1]) - p.y, set((float)light[2]) - p.z};
    real square = vec_dot(l, l), per = set(1.0f) / root(square);
    l = vec_scale(l, per);
    real facing = vec_dot(n, l);
    at->lit = both(at->hit.found, both(greater(facing, zero), greater(square, zero)));
    at->facing = facing;
    at->to_light = l;
    real shine = vec_dot(vec_reflect(l, n), ray->direction), specular = zero;
    mask shines = both(at->lit, greater(shine, surface->shine_from));
    if (any(shines))
        specular = keep(shines, set(0.2f) * power_of(most_of(shine, set(1e-30f)), surface->shininess));
    real reach = weight * per;
    at->light = (struct vec){set((float)e[0]) * mul_add(base.x, facing, specular) * reach,
                             set((float)e[1]) * mul_add(base.y, facing, specular) * reach,
                             set((float)e[2]) * mul_add(base.z, facing, specular) * reach};
}

static inline void stage_shadow(struct stage *at, const struct convex *work) {
    const struct model *model = &work->scene->model;
    at->open = at->lit;
    if (!any(at->lit))
        return;
    if (model->shadows == SHADOWS_SOFT)
        at->open = cleared(at->point, at->hit.local, at->to_light, at->hit.shape, at->lit, work);
    else if (model->shadows == SHADOWS_HARD) {
        struct vec to = {set((float)work->view->light_position[0]) - at->point.x,
                         set((float)work->view->light_position[1]) - at->point.y,
                         set((float)work->view->light_position[2]) - at->point.z};
        at->open = reaches_light(at->point, at->to_light, vec_norm(to), at->lit, work);
    }
}

// What reaches the pixels at once; what a shadow or a mirror ray will bring waits.
static inline void stage_end(struct stage *at, const struct convex *work) {
    const struct model *model = &work->scene->model;
    real zero = set(0.0f);
    mask open = at->open;
    if (model->shadows == SHADOWS_SOFT) {
        mask asked = but_not(open, at->lit);
        mask grazes = both(open, less(at->facing, set(work->scene->lit_slope)));
        if (any(asked))
            queue_shadow(asked, at->point, &at->hit, at->to_light, at->facing, at->light, at->ray.pixel, work);
        if (any(grazes))
            at->light = grazed(at->light, grazes, &at->hit, at->to_light, at->facing, work->scene);
    }
    at->color.x = at->color.x + keep(open, at->light.x);
    at->color.y = at->color.y + keep(open, at->light.y);
    at->color.z = at->color.z + keep(open, at->light.z);
    if (model->features.mirrors && model->march.max_bounces > 0) {
        mask mirror = both(both(at->hit.found, greater(at->surface.share, zero)),
                           less(at->ray.bounce, set((float)model->march.max_bounces)));
        if (any(mirror))
            queue_mirror(mirror, &at->ray, at->point, at->surface.normal, at->weight * at->surface.share, work);
    }
}

static void color_all(struct stage *stage, int count, const struct convex *work) {
    const struct model *model = &work->scene->model;
    for (int i = 0; i < count; i++)
        stage_surface(&stage[i], work->scene);
    for (int i = 0; i < count; i++)
        if (any(stage[i].hit.found))
            stage_light(&stage[i], work->view, model);
    for (int i = 0; i < count; i++)
        if (any(stage[i].hit.found))
            stage_shadow(&stage[i], work);
    for (int i = 0; i < count; i++)
        if (any(stage[i].hit.found))
            stage_end(&stage[i], work);
        else
            stage[i].color = background(stage[i].ray.weight, model);
}

// Rays through a Mandelbulb's bounding sphere that wait for march_bulb(). `before`, the way to where they are
// nearest to its centre, is taken off; slot: of the first lane.
static int gather_bulb(int count, const struct placed *s, struct vec o, const struct ray *ray, real end, int slot,
                       const struct prepared *scene, struct desk *desk) {
    struct vec d = turned(s, ray->direction);
    mask active = ray->active;
    real height = set(INFINITY), slope = set(0.0f);
    if (scene->plane >= 0) {
        const struct placed *plane = &scene->placed[scene->plane];
        height = height_over(plane, ray->origin);
        slope = vec_dot(vec_set(plane->normal), ray->direction);
    }
    real zero = set(0.0f), before = zero - vec_dot(o, d);
    struct vec c = vec_along(o, d, before);
    real square = vec_dot(c, c), half = root(most_of(set(s->bound_sq) - square, zero));
    // The sphere's middle is no origin that all bulbs of a ray share: distances are the ray's own.
    real to = least_of(before + half, end);
    mask near = both(both(active, less(square, set(s->bound_sq))),
                     both(less(before - half, to), greater(to, zero)));
    if (!any(near))
        return count;
    float(*field)[BULB_ROOM] = desk->bulb;
    const real values[B_FIELDS] = {c.x, c.y, c.z, d.x, d.y, d.z, zero - before, to - before, lane_numbers() + set((float)slot), before,
                                     mul_add(before, slope, height), slope};
    for (int i = 0; i < B_FIELDS; i++)
        pack(near, values[i], field[i] + count);
    return count + count_of(near);
}

static inline void take_bulb(struct stage *at, const struct eye *eyes, int slot, const struct convex *work) {
    const struct desk *desk = work->desk;
    real t = load(desk->met + slot), shape = load(desk->met_shape + slot);
    mask met = both(at->ray.active, less(t, at->hit.t));
    if (!any(met))
        return;
    at->hit.found = either(at->hit.found, met);
    at->hit.t = choose(met, t, at->hit.t);
    at->hit.shape = choose(met, shape, at->hit.shape);
    for (int i = 0; i < work->scene->model.shape_count; i++) {
        const struct placed *s = &work->scene->placed[i];
        mask here = both(met, same_shape(shape, i));
        if (s->type != SHAPE_MANDELBULB || !any(here))
            continue;
        struct vec o = eyes ? vec_set(eyes[i].at) : in_frame(s, at->ray.origin), d = turned(s, at->ray.direction);
        real before = set(0.0f) - vec_dot(o, d);
        at->hit.local = vec_choose(here, vec_along(vec_along(o, d, before), d, t - before), at->hit.local);
    }
}

static void clear_met(struct desk *desk, int slots) {
    for (int i = 0; i < slots; i += LANES) {
        unload(set(INFINITY), desk->met + i);
        unload(set(-1.0f), desk->met_shape + i);
    }
}

static void meet_bulbs(struct stage *stage, int packets, const struct convex *work) {
    const struct prepared *scene = work->scene;
    clear_met(work->desk, packets * LANES);
    for (int i = 0; i < scene->model.shape_count; i++) {
        const struct placed *s = &scene->placed[i];
        if (s->type != SHAPE_MANDELBULB)
            continue;
        int count = 0;
        for (int k = 0; k < packets; k++)
            count = gather_bulb(count, s, in_frame(s, stage[k].ray.origin), &stage[k].ray, stage[k].hit.t, k * LANES,
                                scene, work->desk);
        march_bulb(s, count, &scene->model.march, work->desk);
    }
    for (int k = 0; k < packets; k++)
        take_bulb(&stage[k], NULL, k * LANES, work);
}

// The last of the rays that wait first: what they see may make more of them.
static void follow_mirrors(const struct convex *work) {
    struct desk *desk = work->desk;
    float(*field)[QUEUE_ROOM] = desk->mirror;
    struct stage stage[GROUP];
    while (desk->mirrors > 0) {
        int packets = 0;
        for (; packets < GROUP && desk->mirrors > 0; packets++) {
            int count = desk->mirrors < LANES ? desk->mirrors : LANES, first = desk->mirrors -= count;
            struct stage *at = &stage[packets];
            at->ray = (struct ray){load_vec(field + M_ORIGIN, first), load_vec(field + M_DIRECTION, first),
                                   load(&field[M_WEIGHT][first]), load(&field[M_PIXEL][first]),
                                   load(&field[M_BOUNCE][first]), first_lanes(count)};
        }
        for (int i = 0; i < packets; i++)
            first_hit(stage[i].ray.origin, stage[i].ray.direction, stage[i].ray.active, NULL, NULL,
                      work->scene->model.shape_count, work->scene, &stage[i].hit);
        if (work->scene->bulbs)
            meet_bulbs(stage, packets, work);
        color_all(stage, packets, work);
        for (int i = 0; i < packets; i++)
            add_light(stage[i].ray.active, stage[i].color, stage[i].ray.pixel, desk);
    }
}

// The part of the picture's plane at distance 1 that the tile's rays go through.
struct window {
    float left, right, bottom, top;
};

// The shapes that lie across it, at least with their bounding spheres.
static int shapes_in(const struct window *w, const struct job *job, int *list) {
    float sides[4] = {sqrtf(1 + w->left * w->left), sqrtf(1 + w->right * w->right),
                      sqrtf(1 + w->bottom * w->bottom), sqrtf(1 + w->top * w->top)};
    int count = 0;
    for (int i = 0; i < job->prepared->model.shape_count; i++) {
        const struct placed *s = &job->prepared->placed[i];
        const float *c = job->prepared->eyes[i].centre;
        if (s->way == LINEAR) { // centre: its normal; a ray (x, y, 1) falls towards it where this is negative
            float x = c[0] > 0 ? w->left : w->right, y = c[1] > 0 ? w->bottom : w->top;
            if (c[0] * x + c[1] * y + c[2] < 1e-6f)
                list[count++] = i;
            continue;
        }
        float r = s->bound * (1 + 1e-5f);
        if (c[2] > -r && w->left * c[2] - c[0] < r * sides[0] && c[0] - w->right * c[2] < r * sides[1] &&
            w->bottom * c[2] - c[1] < r * sides[2] && c[1] - w->top * c[2] < r * sides[3])
            list[count++] = i;
    }
    return count;
}

struct block {
    int column, row;  // of lane 0; lane i is i % 4 to the right and i / 4 below
    int across, down; // what of it is in the picture
};

static void store_plane(float *plane, int stride, const struct frame *frame, struct block block, real values) {
    float lanes[LANES];
    unload(values, lanes);
    for (int row = 0; row < block.down; row++) {
        size_t first = (size_t)(block.row + row) * (size_t)frame->width + (size_t)block.column;
        for (int i = 0; i < block.across; i++)
            plane[(first + (size_t)i) * (size_t)stride] = lanes[row * BLOCK_WIDTH + i];
    }
}

static void store_hit(struct frame *frame, struct block block, const struct found *hit, struct vec normal) {
    store_plane(frame->depth, 1, frame, block, choose(hit->found, hit->t, set(INFINITY)));
    store_plane(frame->id, 1, frame, block, choose(hit->found, hit->shape, set(-1.0f)));
    store_plane(frame->normal, 3, frame, block, keep(hit->found, normal.x));
    store_plane(frame->normal + 1, 3, frame, block, keep(hit->found, normal.y));
    store_plane(frame->normal + 2, 3, frame, block, keep(hit->found, normal.z));
    store_plane(frame->evals, 1, frame, block, set(1.0f));
}

static void store_colors(struct frame *frame, struct block block, const float *color) {
    real red = load(color), green = load(color + TILE_PIXELS), blue = load(color + 2 * TILE_PIXELS);
    float *rgb = frame->rgb + 3 * ((size_t)block.row * (size_t)frame->width + (size_t)block.column);
    if (block.across == BLOCK_WIDTH && block.down == BLOCK_HEIGHT) {
        store_block(rgb, 3 * (size_t)frame->width, red, green, blue);
        return;
    }
    store_plane(frame->rgb, 3, frame, block, red);
    store_plane(frame->rgb + 1, 3, frame, block, green);
    store_plane(frame->rgb + 2, 3, frame, block, blue);
}

static int lesser(int a, int b) {
    return a < b ? a : b;
}

static inline mask in_picture(struct block block) {
    if (block.across == BLOCK_WIDTH && block.down == BLOCK_HEIGHT)
        return all_lanes();
    real below = floor_of(lane_numbers() * set(1.0f / BLOCK_WIDTH));
    return both(less(lane_numbers() - below * set(BLOCK_WIDTH), set((float)block.across)),
                less(below, set((float)block.down)));
}

static void fill_background(struct frame *frame, int left, int right, int top, int bottom, const struct model *model) {
    float color[3] = {(float)model->background[0], (float)model->background[1], (float)model->background[2]};
    for (int row = top; row < bottom; row++) {
        size_t first = (size_t)row * (size_t)frame->width + (size_t)left, count = (size_t)(right - left);
        for (size_t i = 3 * first; i < 3 * (first + count); i += 3)
            for (int k = 0; k < 3; k++)
                frame->rgb[i + (size_t)k] = color[k];
        for (size_t i = first; frame->depth && i < first + count; i++) {
            frame->depth[i] = INFINITY;
            frame->id[i] = -1;
            frame->normal[3 * i] = frame->normal[3 * i + 1] = frame->normal[3 * i + 2] = 0;
            frame->evals[i] = 0;
        }
    }
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

// A camera ray and what it meets, but for Mandelbulbs.
static inline void look(const struct tile *tile, struct block block, int slot, const struct job *job,
                        const struct desk *desk, struct stage *at) {
    const struct frame *frame = job->frame;
    real two = set(2.0f), per_height = set(tile->per_height);
    real x = mul_add(two, tile->beside, set((float)(2 * block.column + 1 - frame->width))) * per_height;
    real y = neg_mul_add(two, tile->below, set((float)(frame->height - 1 - 2 * block.row))) * per_height;
    struct vec d = vec_along(vec_along(tile->ahead, tile->across, x), tile->up, y);
    d = vec_scale(d, set(1.0f) / vec_norm(d));
    at->ray = (struct ray){tile->eye, d, set(1.0f), lane_numbers() + set((float)slot), set(0.0f), in_picture(block)};
    first_hit(tile->eye, d, at->ray.active, job->prepared->eyes, desk->list, desk->listed, job->prepared, &at->hit);
}

static void look_for_bulbs(const struct tile *tile, const struct job *job, struct desk *desk) {
    clear_met(desk, TILE_WIDTH * BULB_TILE_HEIGHT);
    for (int k = 0; k < desk->listed; k++) {
        const struct placed *s = &job->prepared->placed[desk->list[k]];
        if (s->type != SHAPE_MANDELBULB)
            continue;
        const float *eye = job->prepared->eyes[desk->list[k]].at;
        int count = 0, slot = 0;
        for (int row = tile->top; row < tile->bottom; row += BLOCK_HEIGHT)
            for (int i = 0; tile->left + i * BLOCK_WIDTH < tile->right; i++, slot += LANES) {
                struct stage at;
                look(tile, block_at(tile, row, i), slot, job, desk, &at);
                count = gather_bulb(count, s, vec_set(eye), &at.ray, at.hit.t, slot, job->prepared, desk);
            }
        march_bulb(s, count, &job->prepared->model.march, desk);
    }
}

void convex_tile(const struct job *job, int number, struct desk *desk) {
    struct frame *frame = job->frame;
    const struct view *view = job->view;
    struct convex work = {job->prepared, view, desk};
    int tiles_across = (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
    int left = number % tiles_across * TILE_WIDTH, top = number / tiles_across * job->tile_height;
    real below = floor_of(lane_numbers() * set(1.0f / BLOCK_WIDTH));
    struct tile tile = {left, lesser(frame->width, left + TILE_WIDTH), top, lesser(frame->height, top + job->tile_height),
                        vec_from(view->position), vec_from(view->forward), vec_from(view->right), vec_from(view->up),
                        below, lane_numbers() - below * set(BLOCK_WIDTH), (float)(view->tan_half_fov / frame->height)};
    struct window window = {(float)(2 * tile.left + 1 - frame->width) * tile.per_height,
                            (float)(2 * tile.right - 1 - frame->width) * tile.per_height,
                            (float)(frame->height + 1 - 2 * tile.bottom) * tile.per_height,
                            (float)(frame->height - 1 - 2 * tile.top) * tile.per_height};
    desk->listed = shapes_in(&window, job, desk->list);
    if (desk->listed == 0) {
        fill_background(frame, tile.left, tile.right, tile.top, tile.bottom, &job->prepared->model);
        return;
    }
    if (job->prepared->bulbs)
        look_for_bulbs(&tile, job, desk);
    struct stage stage[GROUP];
    int pixel = 0;
    for (int row = tile.top; row < tile.bottom; row += BLOCK_HEIGHT) {
        int count = 0;
        for (; tile.left + count * BLOCK_WIDTH < tile.right; count++) {
            struct stage *at = &stage[count];
            look(&tile, block_at(&tile, row, count), pixel + count * LANES, job, desk, at);
            if (job->prepared->bulbs)
                take_bulb(at, job->prepared->eyes, pixel + count * LANES, &work);
        }
        color_all(stage, count, &work);
        for (int i = 0; i < count; i++, pixel += LANES) {
            if (frame->depth)
                store_hit(frame, block_at(&tile, row, i), &stage[i].hit, stage[i].surface.normal);
            float *to = &desk->color[pixel];
            unload(stage[i].color.x, to);
            unload(stage[i].color.y, to + TILE_PIXELS);
            unload(stage[i].color.z, to + 2 * TILE_PIXELS);
        }
        if (desk->mirrors > QUEUE / 2)
            follow_mirrors(&work);
    }
    follow_mirrors(&work);
    cast_shadows(&work);
    pixel = 0;
    for (int row = tile.top; row < tile.bottom; row += BLOCK_HEIGHT)
        for (int i = 0; tile.left + i * BLOCK_WIDTH < tile.right; i++, pixel += LANES)
            store_colors(frame, block_at(&tile, row, i), &desk->color[pixel]);
}
