// The light of a plane along a row: polynomials of degree 5 through six nodes, in pieces. Their error is bounded before
// (spans/, PROOFS.md).
#pragma once

enum { PIECES = 128, DEGREE = 5, NODES = DEGREE + 1, BEFORE = 2, LINE = 256 };

// DIFFUSE: light by the facing of the plane, with the highlight of a plane of one grey; FOGGED: what is left of a colour.
enum channel { DIFFUSE, SPECULAR, FOGGED, FACING, CHANNELS };

// Pieces of `spacing` pixels. A piece's node j is at its left edge plus (j - BEFORE) spacings.
struct smooth {
    int plane, spacing, first; // spacing 0: none; first: the first piece's number in the row
    float of[CHANNELS][NODES][PIECES];
    float line[3 * LINE]; // pixels of the row, on their way to where they are displayed
};

INLINE bool is_grey(const struct primitive *s) {
    return s->color[0] == s->color[1] && s->color[1] == s->color[2];
}

// Light of a plane, before its colour and that of the light.
struct plane_light {
    vfloat of[CHANNELS];
};

INLINE bool has_channel(int i, int channel, const struct fused *f) {
    return channel == DIFFUSE || channel == FOGGED || (channel == SPECULAR && !is_grey(SHAPE(i))) ||
           (channel == FACING && f->low[i]);
}

// The vector from the camera to the plane along d, of any length.
INLINE struct vec to_plane(int i, struct vec d, const struct fused *f) {
    vfloat slope = add_dot(SHAPE(i)->normal, d);
    return vec_scale(d, v_splat(-f->height[i]) * quick_inverse(slope));
}

INLINE void light_nodes(int i, struct vec d, const struct fused *f, struct plane_light *to) {
    const struct primitive *s = SHAPE(i);
    struct vec v = to_plane(i, d, f),
               p = {v.x + v_splat(f->eye[0]), v.y + v_splat(f->eye[1]), v.z + v_splat(f->eye[2])};
    struct vec l = vec_sub(vec_set(f->light), p);
    vfloat per = v_rsqrt_newton(vec_dot(l, l)), weight = through_fog(p, INFINITY),
           reach = weight * per;
    vfloat height = v_splat(f->light_height[i]), facing = height * per;
    vfloat shine = v_madd(height + height, v_splat(f->height[i]), vec_dot(l, v));
    shine = shine * per * v_rsqrt_newton(vec_dot(v, v));
    vfloat specular = highlight(s, shine);
    to->of[FOGGED] = weight * v_splat(0.01f);
    to->of[FACING] = facing;
    to->of[SPECULAR] = specular * reach;
    to->of[DIFFUSE] = facing * reach;
    if (is_grey(s))
        to->of[DIFFUSE] = v_madd(v_splat(s->color[0]), facing, specular) * reach;
}

// From values at the nodes to coefficients of u, 0 <= u < 1 in the piece.
static const float to_coefficients[NODES][NODES] = {
    {0, 0, 1, 0, 0, 0},
    {1 / 20.0f, -1 / 2.0f, -1 / 3.0f, 1, -1 / 4.0f, 1 / 30.0f},
    {-1 / 24.0f, 2 / 3.0f, -5 / 4.0f, 2 / 3.0f, -1 / 24.0f, 0},
    {-1 / 24.0f, -1 / 24.0f, 5 / 12.0f, -7 / 12.0f, 7 / 24.0f, -1 / 24.0f},
    {1 / 24.0f, -1 / 6.0f, 1 / 4.0f, -1 / 6.0f, 1 / 24.0f, 0},
    {-1 / 120.0f, 1 / 24.0f, -1 / 12.0f, 1 / 12.0f, -1 / 24.0f, 1 / 120.0f}};

#define EACH_NODE _Pragma("GCC unroll 8")

INLINE void coefficients(const float *nodes, float to[NODES][PIECES], int piece) {
    vfloat n[NODES];
    EACH_NODE
    for (int j = 0; j < NODES; j++)
        n[j] = v_load(nodes + piece + j);
    EACH_NODE
    for (int c = 0; c < NODES; c++) {
        vfloat sum = v_splat(0.0f);
        EACH_NODE
        for (int j = 0; j < NODES; j++)
            if (to_coefficients[c][j] != 0.0f)
                sum = v_madd(n[j], v_splat(to_coefficients[c][j]), sum);
        v_store(sum, &to[c][piece]);
    }
}

// Sets the pieces for columns x0 <= x < x1. Precondition: they are no more than PIECES.
INLINE void set_smooth(int i, int spacing, int x0, int x1, const struct fused *f,
                       const struct row *r, struct smooth *w) {
    float nodes[CHANNELS][PIECES + 2 * LANES];
    w->plane = i;
    w->spacing = spacing;
    w->first = x0 / spacing;
    int count = (x1 - 1) / spacing - w->first + 1;
    for (int j = 0; j < count + DEGREE; j += LANES) {
        vfloat piece = v_iota() + v_splat((float)(w->first + j - BEFORE));
        vfloat at =
            v_madd(piece, v_splat(2.0f * (float)spacing), v_splat((float)(1 - f->frame.width)));
        struct plane_light light;
        light_nodes(i, vec_along(r->d, vec_set(f->right), at * v_splat(f->per)), f, &light);
        for (int c = 0; c < CHANNELS; c++)
            if (has_channel(i, c, f))
                v_store(light.of[c], nodes[c] + j);
    }
    for (int j = 0; j < count; j += LANES)
        for (int c = 0; c < CHANNELS; c++)
            if (has_channel(i, c, f))
                coefficients(nodes[c], w->of[c], j);
}

INLINE vfloat polynomial(const float of[NODES][PIECES], int piece, vfloat u) {
    vfloat sum = v_splat(of[DEGREE][piece]);
    EACH_NODE
    for (int c = DEGREE - 1; c >= 0; c--)
        sum = v_madd(sum, u, v_splat(of[c][piece]));
    return sum;
}

INLINE struct plane_light smooth_at(int i, const struct smooth *w, int x, const struct fused *f) {
    int piece = x / w->spacing; // a power of two
    vfloat u =
        (v_iota() + v_splat((float)(x - piece * w->spacing))) * v_splat(1.0f / (float)w->spacing);
    struct plane_light light;
    for (int c = 0; c < CHANNELS; c++)
        if (has_channel(i, c, f))
            light.of[c] = polynomial(w->of[c], piece - w->first, u);
    return light;
}

// The colour of plane i where `share` of the light arrives.
INLINE struct vec plane_color(int i, const struct plane_light *light, vfloat share,
                              const struct fused *f) {
    const struct primitive *s = SHAPE(i);
    const float *e = f->emission;
    vfloat fogged = light->of[FOGGED];
    if (is_grey(s)) {
        vfloat bright = light->of[DIFFUSE] * share, ambient = fogged * v_splat(s->color[0]);
        return (struct vec){v_madd(bright, v_splat(e[0]), ambient),
                            v_madd(bright, v_splat(e[1]), ambient),
                            v_madd(bright, v_splat(e[2]), ambient)};
    }
    vfloat color[3];
    for (int k = 0; k < 3; k++) {
        vfloat base = v_splat(s->color[k]);
        vfloat bright = v_madd(base, light->of[DIFFUSE], light->of[SPECULAR]) * share;
        color[k] = v_madd(bright, v_splat(e[k]), fogged * base);
    }
    return (struct vec){color[0], color[1], color[2]};
}

// The shares of light that plane i and the solids in `bits` leave of it along d, of any length.
INLINE void plane_shares(int i, const struct vec d[ROWS], uint64_t bits, const vmask m[ROWS],
                         const struct plane_light light[ROWS], const struct fused *f,
                         vfloat share[ROWS]) {
    vfloat best[ROWS];
    EACH_ROW(k) {
        best[k] = lit_best();
        if (f->low[i])
            best[k] = v_min(best[k], v_max(light[k].of[FACING], v_splat(0.0f)));
    }
    if (bits) {
        struct light_rays rays[ROWS];
        EACH_ROW(k) {
            struct vec v = to_plane(i, d[k], f);
            struct vec p = {v.x + v_splat(f->eye[0]), v.y + v_splat(f->eye[1]),
                            v.z + v_splat(f->eye[2])};
            struct vec l = vec_sub(vec_set(f->light), p);
            vfloat square = vec_dot(l, l), per = v_rsqrt_newton(square);
            set_light_rays(&rays[k], p, l, per, square * per, m[k]);
        }
        darken_by_others(bits, rays, best);
    }
    EACH_ROW(k) share[k] = light_share(best[k]);
}
