// Draws a band of rows, span by span, each packet in registers from its direction to its pixel.
#pragma once

INLINE void background_span(const struct fused *f, const struct row r[ROWS],
                            const struct fused_span *span) {
    const double *b = scene_known.model.background;
    struct vec color = {v_splat((float)b[0]), v_splat((float)b[1]), v_splat((float)b[2])};
    EACH_ROW(k)
    for (int x = span->x0; x < span->x1; x += LANES)
        put(f, &r[k], x, color);
}

// Whether plane i is no mirror, or its mirror rays in a span see only a black background.
INLINE bool mirrors_nothing(int i, const struct fused_span *span, const struct fused *f) {
    const double *b = scene_known.model.background;
    bool black = b[0] == 0.0 && b[1] == 0.0 && b[2] == 0.0;
    return !(SHAPE(i)->share > 0.0f) ||
           (black && !span->reflected && f->frame.planes == (uint64_t)1 << i);
}

// A plane alone, its light from polynomials, or else pixel by pixel.
INLINE void plane_span(int i, const bool smooth, const struct fused *f, const struct row r[ROWS],
                       const struct fused_span *span, const struct smooth w[ROWS]) {
    bool dark = scene_known.model.shadows != SHADOWS_NONE && (f->low[i] || span->darkeners);
    for (int x = span->x0; x < span->x1; x += LANES) {
        struct plane_light light[ROWS];
        vfloat share[ROWS];
        EACH_ROW(k) {
            if (smooth)
                light[k] = smooth_at(i, &w[k], x, f);
            else
                light_nodes(i, look(f, &r[k], x), f, &light[k]);
            share[k] = v_splat(1.0f);
        }
        if (dark) {
            struct vec d[ROWS];
            vmask all[ROWS];
            EACH_ROW(k) {
                d[k] = look(f, &r[k], x);
                all[k] = v_mask_all();
            }
            plane_shares(i, d, span->darkeners, all, light, f, share);
        }
        EACH_ROW(k) put(f, &r[k], x, plane_color(i, &light[k], share[k], f));
    }
}

// Adds the light of the pixels whose nearest hit is a plane of polynomials, and takes them from the hits.
INLINE void smooth_lanes(int i, struct ends end[ROWS], int x, const struct fused_span *span,
                         const struct smooth w[ROWS], const struct fused *f,
                         struct vec color[ROWS]) {
    if (w[0].plane != i || !w[0].spacing || !mirrors_nothing(i, span, f))
        return;
    vmask on[ROWS];
    EACH_ROW(k) on[k] = v_and(end[k].hit.found, is_shape(end[k].hit.shape, i));
    if (!any_of(on))
        return;
    struct plane_light light[ROWS];
    vfloat share[ROWS];
    struct vec d[ROWS];
    EACH_ROW(k) {
        light[k] = smooth_at(i, &w[k], x, f);
        share[k] = v_splat(1.0f);
        d[k] = end[k].d;
    }
    if (scene_known.model.shadows != SHADOWS_NONE)
        plane_shares(i, d, span->darkeners, on, light, f, share);
    EACH_ROW(k) {
        add_where(on[k], &color[k], plane_color(i, &light[k], share[k], f));
        end[k].hit.found = v_andnot(on[k], end[k].hit.found);
    }
}

// Intersects camera rays with solid i.
#define MEET(i)                                                                                    \
    INLINE void meet_solid_##i(const struct job *job, struct ends end[ROWS]) {                     \
        if (SHAPE(i)->type != SHAPE_TORUS) {                                                       \
            EACH_ROW(k)                                                                            \
            camera_hit(i, end[k].d, v_mask_all(), job->cameras, job->prepared, &end[k].hit);       \
            return;                                                                                \
        }                                                                                          \
        struct vec o[ROWS], d[ROWS];                                                               \
        vmask all[ROWS];                                                                           \
        struct torus_hit hit[ROWS];                                                                \
        EACH_ROW(k) {                                                                              \
            o[k] = vec_set(job->cameras[i].at);                                                    \
            d[k] = turned(SHAPE(i), end[k].d);                                                     \
            all[k] = v_mask_all();                                                                 \
        }                                                                                          \
        enter_tori_##i(o, d, all, hit);                                                            \
        EACH_ROW(k)                                                                                \
        take_hit(v_and(hit[k].met, v_cmp_lt(hit[k].t, end[k].hit.t)), hit[k].t, hit[k].local,      \
                 SHAPE(i), &end[k].hit);                                                           \
    }
EACH_SOLID(MEET)
#undef MEET

INLINE void meet_plane(int i, struct vec d, const struct fused *f, struct surface_hit *hit) {
    vfloat slope = add_dot(SHAPE(i)->normal, d), zero = v_splat(0.0f);
    vfloat t = v_splat(f->height[i]) * quick_inverse(zero - slope);
    take_hit(v_and(v_cmp_lt(slope, zero), v_cmp_lt(t, hit->t)), t, hit->local, SHAPE(i), hit);
}

// The other planes of a frame with channels.
NOINLINE void store_channels(const struct row *r, int x, const struct surface_hit *hit,
                             const struct vec *d, const struct job *job) {
    struct surface surface;
    surface_at(hit, d, job->prepared, &surface);
    store_hit(job->frame, (struct pixel_block){x, r->y, int_min(LANES, job->frame->width - x), 1},
              hit, surface.normal);
}

// Follows the mirror rays that leave the shapes of a span.
INLINE void follow_from(const struct fused_span *span, struct mirror_rays next[ROWS],
                        const struct fused *f, struct vec color[ROWS]) {
    uint64_t may = 0;
    int guarded = -1, mirrors = 0;
#define LEAVE(i)                                                                                   \
    if (SHAPE(i)->share > 0.0f && span->hits >> (i) & 1) {                                         \
        const bool flat = SHAPE(i)->eval == EVAL_LINEAR;                                           \
        may |= flat ? span->reflected : f->frame.mirror[i];                                        \
        guarded = mirrors++ || flat ? -1 : (i);                                                    \
    }
    EACH_PLANE(LEAVE)
    EACH_SOLID(LEAVE)
#undef LEAVE
    follow_mirror(next, may, guarded, f, color);
}

// Packets that may see several shapes, or an edge.
NOINLINE void mixed_packets(const struct fused *f, const struct row r[ROWS], int x,
                            const struct fused_span *span, const struct smooth w[ROWS],
                            const struct job *job) {
    struct ends end[ROWS];
    EACH_ROW(k) {
        end[k].d = look_at_edges(f, &r[k], x);
        end[k].weight = v_splat(1.0f);
        no_hit(&end[k].hit);
    }
#define MEET(i)                                                                                    \
    if (span->hits >> (i) & 1)                                                                     \
        meet_solid_##i(job, end);
    EACH_SOLID(MEET)
#undef MEET
#define MEET(i)                                                                                    \
    if (span->hits >> (i) & 1)                                                                     \
        EACH_ROW(k) meet_plane(i, end[k].d, f, &end[k].hit);
    EACH_PLANE(MEET)
#undef MEET
    struct vec color[ROWS], zero = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    struct mirror_rays next[ROWS];
    EACH_ROW(k) {
        end[k].p = vec_along(vec_set(f->eye), end[k].d, end[k].hit.t);
        color[k] = zero;
        keep_in_bounds(vec_set(f->eye), end[k].d, end[k].p, &end[k].hit);
        add_where(v_not(end[k].hit.found), &color[k],
                  background(v_splat(1.0f), &scene_known.model));
        if (job->frame->depth)
            store_channels(&r[k], x, &end[k].hit, &end[k].d, job);
        no_mirror_rays(&next[k]);
    }
#define SMOOTH(i) smooth_lanes(i, end, x, span, w, f, color);
    EACH_PLANE(SMOOTH)
#undef SMOOTH
    vmask found[ROWS];
    EACH_ROW(k) found[k] = end[k].hit.found;
    if (any_of(found))
        shade_hits(end, span->hits, false, span->darkeners, f, color, next);
    if (any_active(next))
        follow_from(span, next, f, color);
    EACH_ROW(k) put(f, &r[k], x, color[k]);
}

// A sphere, each pixel well inside of its outline.
INLINE void sphere_span(int i, const struct fused *f, const struct row r[ROWS],
                        const struct fused_span *span, const struct job *job) {
    const struct primitive *s = SHAPE(i);
    struct vec o = vec_set(job->cameras[i].at), at_world = vec_set(s->position);
    vfloat zero = v_splat(0.0f);
    for (int x = span->x0; x < span->x1; x += LANES) {
        struct seen at[ROWS];
        struct vec color[ROWS];
        struct mirror_rays next[ROWS];
        vfloat weight[ROWS];
        EACH_ROW(k) {
            struct vec d = look(f, &r[k], x);
            d = vec_scale(d, v_rsqrt_newton(vec_dot(d, d)));
            struct vec along = turned(s, d), c = vec_along(o, along, zero - vec_dot(o, along));
            vfloat rest = v_max(v_splat(s->bound_sq) - vec_dot(c, c), v_splat(1e-20f));
            struct vec local = vec_along(c, along, zero - rest * v_rsqrt_newton(rest));
            struct vec up = turned_back(s, local);
            struct vec p = {up.x + at_world.x, up.y + at_world.y, up.z + at_world.z};
            set_seen(&at[k], v_mask_all(), local, p, vec_scale(up, v_splat(1.0f / s->a)), d,
                     v_splat(1.0f));
            color[k] = (struct vec){zero, zero, zero};
        }
        shade_shape(i, at, f->frame.pair[i], f, color, weight);
        EACH_ROW(k) reflect_all(i, &at[k], weight[k], &next[k]);
        if (s->share > 0.0f && scene_known.model.march.max_bounces > 0)
            follow_mirror(next, f->frame.mirror[i], i, f, color);
        EACH_ROW(k) put(f, &r[k], x, color[k]);
    }
}

// A convex solid that is no mirror, each pixel well inside of its outline.
INLINE void solid_span(int i, const struct fused *f, const struct row r[ROWS],
                       const struct fused_span *span, const struct job *job) {
    vfloat zero = v_splat(0.0f);
    for (int x = span->x0; x < span->x1; x += LANES) {
        struct seen at[ROWS];
        struct vec color[ROWS];
        vfloat weight[ROWS];
        EACH_ROW(k) {
            struct vec d = look_at_edges(f, &r[k], x);
            struct surface_hit hit;
            no_hit(&hit);
            camera_hit(i, d, v_mask_all(), job->cameras, job->prepared, &hit);
            set_seen(&at[k], hit.found, hit.local, vec_along(vec_set(f->eye), d, hit.t),
                     normal_towards(i, hit.local, d), d, v_splat(1.0f));
            color[k] = (struct vec){zero, zero, zero};
        }
        shade_shape(i, at, f->frame.pair[i], f, color, weight);
        EACH_ROW(k) put(f, &r[k], x, color[k]);
    }
}

#define SPAN(i)                                                                                    \
    NOINLINE void solid_span_##i(const struct fused *f, const struct row r[ROWS],                  \
                                 const struct fused_span *span, const struct job *job) {           \
        solid_span(i, f, r, span, job);                                                            \
    }
EACH_SOLID(SPAN)
#undef SPAN

#define SPAN(i)                                                                                    \
    NOINLINE void plane_span_##i(const struct fused *f, const struct row r[ROWS],                  \
                                 const struct fused_span *span, const struct smooth w[ROWS]) {     \
        plane_span(i, true, f, r, span, w);                                                        \
    }                                                                                              \
    NOINLINE void plain_span_##i(const struct fused *f, const struct row r[ROWS],                  \
                                 const struct fused_span *span, const struct smooth w[ROWS]) {     \
        plane_span(i, false, f, r, span, w);                                                       \
    }                                                                                              \
    NOINLINE void set_smooth_##i(int spacing, int x0, int x1, const struct fused *f,               \
                                 const struct row *r, struct smooth *w) {                          \
        set_smooth(i, spacing, x0, x1, f, r, w);                                                   \
    }
EACH_PLANE(SPAN)
#undef SPAN

static void draw_span(const struct fused *f, const struct row r[ROWS],
                      const struct fused_span *span, const struct smooth w[ROWS],
                      const struct job *job) {
    bool mixed = span->kind == SPAN_MIXED || job->frame->depth; // which alone sets channels
    for (int x = span->x0; x < span->x1 && mixed; x += LANES)
        mixed_packets(f, r, x, span, w, job);
    if (span->kind == SPAN_BACKGROUND) {
        background_span(f, r, span);
        return;
    }
#define SPAN(i)                                                                                    \
    if (span->kind == SPAN_PLANE && span->shape == (i) && w[0].plane == (i) &&                     \
        mirrors_nothing(i, span, f)) {                                                             \
        (w[0].spacing ? plane_span_##i : plain_span_##i)(f, r, span, w);                           \
        return;                                                                                    \
    }
    EACH_PLANE(SPAN)
#undef SPAN
#define SPAN(i)                                                                                    \
    if (SHAPE(i)->type == SHAPE_SPHERE && span->kind == SPAN_SOLID && span->shape == (i)) {        \
        sphere_span(i, f, r, span, job);                                                           \
        return;                                                                                    \
    }                                                                                              \
    if (SHAPE(i)->convex && !(SHAPE(i)->share > 0.0f) && span->kind == SPAN_SOLID &&               \
        span->shape == (i)) {                                                                      \
        solid_span_##i(f, r, span, job);                                                           \
        return;                                                                                    \
    }
    EACH_SOLID(SPAN)
#undef SPAN
    for (int x = span->x0; x < span->x1 && !mixed; x += LANES)
        mixed_packets(f, r, x, span, w, job);
}

// So few pixels are sooner drawn than their polynomial is found.
enum { FEW = 320 };

// The most that a polynomial may err, of a colour.
#define SMOOTH_ERROR 1e-6

// Finds the plane that the spans see, if it is one alone that no other can darken, and how far apart nodes may be.
static int spacing_of(const struct fused *f, const struct fused_span *spans, int count, int y,
                      int rows, int *plane, int *x0, int *x1) {
    uint64_t seen = 0;
    *x0 = f->frame.width;
    *x1 = 0;
    for (int k = 0; k < count; k++) {
        if (!(spans[k].hits & f->frame.planes))
            continue;
        seen |= spans[k].hits & f->frame.planes;
        *x0 = int_min(*x0, spans[k].x0);
        *x1 = spans[k].x1;
    }
    *plane = -1;
    if (!seen || seen & (seen - 1) || (f->any_low && f->frame.planes != seen))
        return 0;
    if (f->light_height[__builtin_ctzll(seen)] <= 0.0f)
        return 0;
    *plane = __builtin_ctzll(seen);
    if (*x1 - *x0 <= FEW)
        return 0;
    int spacing = fused_spacing(&f->frame, *plane, y, rows, *x0, *x1, SMOOTH_ERROR);
    return spacing && (*x1 - *x0) / spacing + 2 <= PIECES - 2 * LANES ? spacing : 0;
}

static int fused_tiles(const struct job *job) {
    return (job->frame->height + SPAN_BAND - 1) / SPAN_BAND;
}

// Draws a span piece by piece beside the picture and copies it there. Of a displayed background one packet is all.
static void copy_span(const struct fused *f, struct row r[ROWS], const struct fused_span *span,
                      struct smooth w[ROWS], const struct job *job) {
    struct frame *frame = job->frame;
    struct fused_span part = *span;
    bool same = frame->shown && span->kind == SPAN_BACKGROUND;
    for (; part.x0 < span->x1; part.x0 = part.x1) {
        bool again = same && part.x0 > span->x0; // as all of the span so far
        int step = !same ? LINE : again ? part.x0 - span->x0 : LANES;
        part.x1 = int_min(span->x1, part.x0 + step);
        for (int k = 0; k < ROWS; k++) {
            r[k].rgb = w[k].line;
            r[k].first = part.x0;
        }
        if (!again)
            draw_span(f, r, &part, w, job);
        for (int k = 0; k < ROWS; k++) {
            size_t at = 3 * ((size_t)r[k].y * (size_t)frame->width + (size_t)part.x0);
            size_t samples = 3 * (size_t)(part.x1 - part.x0);
            if (!frame->shown)
                memcpy(frame->rgb + at, w[k].line, samples * sizeof(float));
            else if (again)
                memcpy(frame->shown + at, frame->shown + at - 3 * step, samples);
            else
                frame->show(frame->presenter, w[k].line, samples, frame->shown + at);
        }
    }
}

// Draws rows y and, if it is in the picture, y + 1.
static void draw_rows(const struct fused *f, const struct fused_band *band, int y, int rows,
                      struct smooth w[ROWS], const struct job *job) {
    struct fused_span spans[SPAN_MOST];
    struct row r[ROWS];
    int count = fused_spans_of_rows(&f->frame, band, y, rows, spans), plane, x0, x1;
    int spacing = spacing_of(f, spans, count, y, rows, &plane, &x0, &x1);
    for (int k = 0; k < ROWS; k++) {
        int row = y + k % rows; // a single last row is drawn twice
        float up = (float)(f->frame.height - 1 - 2 * row) * f->per;
        r[k] = (struct row){vec_along(vec_set(f->forward), vec_set(f->up), v_splat(up)), up, row, 0,
                            job->frame->rgb + 3 * (size_t)row * (size_t)f->frame.width};
        w[k].plane = plane;
        w[k].spacing = 0;
#define SET(i)                                                                                     \
    if (spacing && plane == (i))                                                                   \
        set_smooth_##i(spacing, x0, x1, f, &r[k], &w[k]);
        EACH_PLANE(SET)
#undef SET
    }
    for (int k = 0; k < count; k++)
        if (job->frame->shown || spans[k].x1 % LANES) // as a picture's right edge may be
            copy_span(f, r, &spans[k], w, job);
        else
            draw_span(f, r, &spans[k], w, job);
}

static void fused_tile(const void *data, int tile, void *memory) {
    const struct job *job = data;
    const struct fused *f = job->frame_memory;
    int top = tile * SPAN_BAND, bottom = int_min(job->frame->height, top + SPAN_BAND);
    struct fused_band band;
    fused_band_set(&f->frame, top, bottom - top, &band);
    for (int y = top; y < bottom; y += ROWS)
        draw_rows(f, &band, y, int_min(ROWS, bottom - y), memory, job);
}
