// The article's render(): a block of 16 × 16 pixels is cleared if the rays through its corners hit nothing; else each
// of its rays runs the mirror loop. The shading is this house's (results/README.md), in numbers.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
#include <string.h>

#include "rays.h"
#include "trace.h"

// x^k for 0 ≤ x ≤ 1 and each lane's own whole k, by repeated squaring.
static num power(num x, num k, const struct world *w) {
    COUNT(power, call);
    const struct format *f = &w->format;
    num y = set(w->whole);
    for (int i = 0; i < w->shine_bits; i++) {
        COUNT(power, bit);
        y = choose(bit_set(k, i), times(y, x, f), y);
        x = times(x, x, f);
    }
    return y;
}

static num capped(num a) {
    return choose(less(a, set(MOST)), a, set(MOST));
}

// What a hit sends back of the light: ambient, diffuse and specular.
static struct vec light_at(struct vec p, struct vec n, struct vec along, const struct hit *hit,
                           const struct world *w) {
    ACTIVE(count_of(hit->found));
    COUNT(light_at, call);
    const struct format *f = &w->format;
    const num ambient = set(w->ambient);
    struct vec base = look_up_vec(w->colour, hit->shape);
    struct vec colour = {times(base.x, ambient, f), times(base.y, ambient, f),
                         times(base.z, ambient, f)};
    struct per distance;
    struct vec way = vec_minus(vec_set(w->light), p), l = normalised(way, f, &distance);
    num facing = sum3(n, l, f);
    mask lit = both(hit->found, positive(facing));
    if (w->shadows && any(lit)) {
        ACTIVE(count_of(lit));
        COUNT(light_at, shadow);
        struct rays ray = {vec_along(p, l, set(w->offset), f), l, lit};
        lit = but_not(blocked(ray, sum3(way, l, f), w), lit);
    }
    if (!any(lit))
        return colour;
    ACTIVE(count_of(lit));
    COUNT(light_at, lit);
    // l mirrored at n, less the paper's R, along the ray
    num twice = plus(facing, facing);
    num shine = minus(sum3(l, along, f), times(twice, sum3(n, along, f), f));
    num most = set(w->whole);
    shine = choose(less(shine, most), shine, most);
    num specular = choose(positive(shine), power(shine, look_up(w->shine, hit->shape), w), set(0));
    specular = times(specular, set(w->fifth), f);
    const one *e = w->emission;
    struct vec reach = {capped(over(set(e[0]), distance)), capped(over(set(e[1]), distance)),
                        capped(over(set(e[2]), distance))};
    struct vec light = {
        plus(colour.x, times(reach.x, plus(times(base.x, facing, f), specular), f)),
        plus(colour.y, times(reach.y, plus(times(base.y, facing, f), specular), f)),
        plus(colour.z, times(reach.z, plus(times(base.z, facing, f), specular), f)),
    };
    light = (struct vec){capped(light.x), capped(light.y), capped(light.z)};
    return vec_choose(lit, light, colour);
}

struct seen {
    struct vec colour, normal;
    struct hit hit;
};

static struct vec normal_of(struct vec p, const struct hit *hit, const struct world *w) {
    ACTIVE(count_of(hit->found));
    COUNT(normal_of, call);
    struct per nothing;
    num at = choose(hit->found, hit->shape, set(0));
    return normalised(vec_minus(p, look_up_vec(w->centre, at)), &w->format, &nothing);
}

// The mirror loop: each bounce adds what its hit sends back, weighed by the mirrors before it.
static struct seen trace(struct rays rays, const struct world *w, const int *list, int count) {
    COUNT(trace, call);
    const struct format *f = &w->format;
    const struct vec sky = vec_set(w->background);
    struct seen seen = {.hit = first_hit(rays.along, w, list, count)};
    seen.hit.found = both(rays.on, seen.hit.found);
    seen.colour = seen.normal = (struct vec){set(0), set(0), set(0)};
    if (!any(seen.hit.found))
        return seen;
    struct hit hit = seen.hit;
    num weight = set(w->whole);
    rays.on = hit.found;
    for (int bounce = 0;; bounce++) {
        ACTIVE(count_of(rays.on));
        COUNT(trace, bounce);
        struct vec p = vec_along(rays.from, rays.along, choose(hit.found, hit.t, set(0)), f);
        hit.shape = choose(hit.found, hit.shape, set(0));
        struct vec n = normal_of(p, &hit, w);
        if (bounce == 0)
            seen.normal = n;
        struct vec light = light_at(p, n, rays.along, &hit, w);
        light = vec_choose(hit.found, light, vec_choose(rays.on, sky, seen.colour));
        struct vec sum = vec_along(seen.colour, light, weight, f);
        seen.colour = vec_choose(rays.on, sum, seen.colour);
        weight = times(weight, look_up(w->mirror, hit.shape), f);
        rays.on = both(hit.found, positive(weight));
        if (bounce == w->bounces || !any(rays.on))
            return seen;
        ACTIVE(count_of(rays.on));
        COUNT(trace, mirror);
        num twice = sum3(rays.along, n, f);
        twice = minus(set(0), plus(twice, twice));
        rays.along = vec_along(rays.along, n, twice, f);
        rays.from = vec_along(p, n, set(w->offset), f);
        hit = next_hit(&rays, w);
    }
}

struct block {
    int column, row, across, down;
};

// The article's test: whether any of the rays through the corners meets a sphere, before or behind the camera.
static bool corner_hit(struct block b, const struct world *w, const struct frame *frame) {
    COUNT(corner_hit, call);
    enum { ROOM = LANES > 4 ? LANES : 4 };
    one across[ROOM], up[ROOM];
    for (int i = 0; i < ROOM; i++) {
        across[i] = 2 * (b.column + (i & 1) * (b.across - 1)) + 1 - frame->width;
        up[i] = frame->height - 1 - 2 * (b.row + (i >> 1 & 1) * (b.down - 1));
    }
    for (int first = 0; first < 4; first += LANES) {
        ACTIVE(4 < LANES ? 4 : LANES);
        struct vec along = get_direction(load(across + first), load(up + first), w);
        for (int i = 0; i < w->count; i++) {
            COUNT(corner_hit, sphere);
            struct vec from = {set(w->eye[0][i]), set(w->eye[1][i]), set(w->eye[2][i])};
            num s = sum3(from, along, &w->format);
            if (any(positive(plus(times(s, s, &w->format), set(w->rest[i])))))
                return true;
        }
    }
    return false;
}

// The spheres that a ray of the block can meet, as indices; how many. 0: it is cleared.
static int candidates(struct block b, const struct world *w, const struct frame *frame, int *list) {
    enum clear clear = w->format.clear;
    int count = 0, column = b.column / BLOCK, row = b.row / BLOCK;
    if (clear == CLEAR_CORNERS && !corner_hit(b, w, frame))
        return 0;
    for (int i = 0; i < w->count; i++)
        if (clear == CLEAR_CORNERS || clear == CLEAR_NEVER ||
            (w->reach[0][i] <= column && column <= w->reach[1][i] && w->reach[2][i] <= row &&
             row <= w->reach[3][i]))
            list[count++] = i;
    if (clear == CLEAR_SAFE && count > 0) // an empty block is all that this one gains from
        for (count = 0; count < w->count; count++)
            list[count] = count;
    return count;
}

static void clear_block(struct block b, const struct world *w, struct frame *frame) {
    for (int row = b.row; row < b.row + b.down; row++)
        for (int column = b.column; column < b.column + b.across; column++) {
            size_t pixel = (size_t)row * (size_t)frame->width + (size_t)column;
            memcpy(frame->rgb + 3 * pixel, w->exact_background, sizeof w->exact_background);
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

// What is asked for beside the colour. A normal is made as long as a frame's is.
static void store_hits(const struct seen *seen, size_t first, int count, const struct world *w,
                       struct frame *frame) {
    COUNT(store_hits, call);
    const struct format *f = &w->format;
    float t[LANES], shape[LANES];
    double normal[3][LANES];
    unload(seen->hit.t, f->length, t);
    unload(seen->hit.shape, 1, shape);
    unload_wide(seen->normal.x, f->scale, normal[0]);
    unload_wide(seen->normal.y, f->scale, normal[1]);
    unload_wide(seen->normal.z, f->scale, normal[2]);
    for (int lane = 0; lane < count; lane++) {
        size_t pixel = first + (size_t)lane;
        COUNT(store_hits, lane);
        bool hit = bit_of(seen->hit.found, lane);
        double n[3] = {normal[0][lane], normal[1][lane], normal[2][lane]};
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        frame->depth[pixel] = hit ? t[lane] : INFINITY;
        frame->id[pixel] = hit ? shape[lane] : -1;
        frame->evals[pixel] = 1;
        if (frame->plane_count)
            frame->planes[0][pixel] = 0;
        for (int i = 0; i < 3; i++)
            frame->normal[3 * pixel + (size_t)i] =
                hit && length > 0 ? (COUNT(store_hits, axis), (float)(n[i] / length)) : 0;
    }
}

static void store(const struct seen *seen, int column, int row, int count, const struct world *w,
                  struct frame *frame) {
    ACTIVE(count);
    COUNT(store, call);
    float r[LANES], g[LANES], b[LANES];
    unload(seen->colour.x, w->format.scale, r);
    unload(seen->colour.y, w->format.scale, g);
    unload(seen->colour.z, w->format.scale, b);
    size_t first = (size_t)row * (size_t)frame->width + (size_t)column;
    for (int i = 0; i < count; i++) {
        const float colour[3] = {r[i], g[i], b[i]};
        bool hit = bit_of(seen->hit.found, i);
        memcpy(frame->rgb + 3 * (first + (size_t)i), hit ? colour : w->exact_background,
               sizeof colour);
    }
    if (frame->depth)
        store_hits(seen, first, count, w, frame);
}

static void render_block(struct block b, const struct world *w, struct frame *frame, int *list) {
    ACTIVE(LANES);
    COUNT(render_block, call);
    int count = candidates(b, w, frame, list);
    if (count == 0) {
        clear_block(b, w, frame);
        return;
    }
    const struct vec eye = vec_set(w->position);
    for (int row = b.row; row < b.row + b.down; row++)
        for (int done = 0; done < b.across; done += LANES) {
            int column = b.column + done, rest = b.across - done;
            ACTIVE(rest < LANES ? rest : LANES);
            COUNT(render_block, packet);
            num lane = ramp();
            num across = plus(plus(lane, lane), set(2 * column + 1 - frame->width));
            struct rays rays = {eye, get_direction(across, set(frame->height - 1 - 2 * row), w),
                                first_lanes(rest)};
            struct seen seen = trace(rays, w, list, count);
            store(&seen, column, row, rest < LANES ? rest : LANES, w, frame);
        }
}

void VARIANT(tile)(const struct job *job, int tile, void *own) {
    struct frame *frame = job->frame;
    const int wide = BLOCK * TILE_BLOCKS, across = (frame->width + wide - 1) / wide;
    const int first = tile % across * wide, row = tile / across * BLOCK;
    for (int column = first; column < first + wide && column < frame->width; column += BLOCK) {
        struct block b = {column, row, frame->width - column, frame->height - row};
        b.across = b.across < BLOCK ? b.across : BLOCK;
        b.down = b.down < BLOCK ? b.down : BLOCK;
        render_block(b, job->world, frame, own);
    }
}
