// See crowd.h. What is asked is the same as of a small scene, first of the spheres about nodes: what those rule out
// they rule out for all in them.
#include "flat.h"
#include "seek.h"
#include "window.h"

static int take_marked(struct desk *desk, const struct prepared *scene, int *list) {
    int count = 0;
    for (int word = 0; word <= (scene->model.shape_count - 1) / 64; word++) {
        for (unsigned long long rest = desk->marks[word]; rest; rest &= rest - 1)
            list[count++] = word * 64 + __builtin_ctzll(rest);
        desk->marks[word] = 0;
    }
    return count;
}

static inline void mark(struct desk *desk, int shape) {
    desk->marks[shape / 64] |= 1ull << shape % 64;
}

static void mark_planes(struct desk *desk, const struct prepared *scene) {
    for (int k = 0; k < scene->plane_count; k++)
        mark(desk, scene->planes[k]);
}

struct seen {
    struct vec eye, right, up, ahead;
    vfloat reach, left, rights, bottom, top, sides[4];
};

static inline vmask lies_across(struct vec centre, vfloat radius, const void *with) {
    COUNT(lies_across, call);
    const struct seen *w = with;
    struct vec v = {centre.x - w->eye.x, centre.y - w->eye.y, centre.z - w->eye.z};
    vfloat x = vec_dot(v, w->right), y = vec_dot(v, w->up), z = vec_dot(v, w->ahead);
    vfloat r = blurred(radius, v, w->reach);
    vmask in = v_cmp_gt(z, v_splat(0.0f) - r);
    in = v_and(in, v_cmp_lt(v_msub(w->left, z, x), r * w->sides[0]));
    in = v_and(in, v_cmp_lt(v_nmadd(w->rights, z, x), r * w->sides[1]));
    in = v_and(in, v_cmp_lt(v_msub(w->bottom, z, y), r * w->sides[2]));
    return v_and(in, v_cmp_lt(v_nmadd(w->top, z, y), r * w->sides[3]));
}

static float farthest(const double a[3]) {
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += a[k] < 0 ? -a[k] : a[k];
    return (float)sum;
}

void crowd_in_window(const struct window *w, const struct job *job, struct desk *desk) {
    COUNT(crowd_in_window, call);
    const struct prepared *scene = job->prepared;
    const struct view *view = job->view;
    struct seen seen = {
        vec_from_doubles(view->position),
        vec_from_doubles(view->right),
        vec_from_doubles(view->up),
        vec_from_doubles(view->forward),
        v_splat(farthest(view->position)),
        v_splat(w->left),
        v_splat(w->right),
        v_splat(w->bottom),
        v_splat(w->top),
        {v_sqrt(v_splat(1 + w->left * w->left)), v_sqrt(v_splat(1 + w->right * w->right)),
         v_sqrt(v_splat(1 + w->bottom * w->bottom)), v_sqrt(v_splat(1 + w->top * w->top))}};
    desk->far = desk->leaf = -1;
    int *list = desk->listed.index, count = list_those(&scene->tree, lies_across, &seen, list);
    for (int k = 0; k < count; k++)
        mark(desk, list[k]);
    for (int k = 0; k < scene->plane_count; k++)
        if (plane_in_window(w, job->prepared->eyes[scene->planes[k]].centre))
            mark(desk, scene->planes[k]);
    desk->listed.count = take_marked(desk, scene, list);
}

// The blocks in the lanes. No camera ray is off by as much as the sphere is wider, nor is what is asked of it then.
void crowd_in_row(const struct window *row, float across, const struct job *job,
                  struct desk *desk) {
    _Static_assert((int)GROUP <= (int)LANES, "a lane for each");
    ACTIVE(GROUP);
    COUNT(crowd_in_row, call);
    COUNT(crowd_in_row, scalar);
    vfloat left = v_madd(v_iota(), v_splat(across), v_splat(row->left)),
           right = left + v_splat(across);
    vfloat left_side = v_sqrt(v_madd(left, left, v_splat(1.0f))),
           right_side = v_sqrt(v_madd(right, right, v_splat(1.0f)));
    float bottom = sqrtf(1 + row->bottom * row->bottom), top = sqrtf(1 + row->top * row->top);
    for (int k = 0; k < GROUP; k++)
        desk->cuts[k] = 0;
    const struct prepared *scene = job->prepared;
    const int *list = desk->listed.index, count = desk->listed.count;
    for (int k = 0; k < count; k++) {
        int i = list[k];
        const struct placed *s = &scene->placed[i];
        const float *c = job->eyes[i].centre;
        unsigned which = (1u << GROUP) - 1;
        if (s->way != LINEAR) {
            COUNT(crowd_in_row, solid);
            float r = s->bound * (1 + 1e-5f) + 1e-6f * (fabsf(c[0]) + fabsf(c[1]) + fabsf(c[2]));
            // Both at once, if the compiler will: gcc 12 asks one after the other.
            if ((row->bottom * c[2] - c[1] > r * bottom) | (c[1] - row->top * c[2] > r * top))
                continue;
            COUNT(crowd_in_row, blocks);
            vfloat x = v_splat(c[0]), z = v_splat(c[2]);
            which &= v_mask_bits(v_and(v_cmp_lt(v_msub(left, z, x), v_splat(r) * left_side),
                                       v_cmp_lt(v_nmadd(right, z, x), v_splat(r) * right_side)));
        }
        for (; which; which &= which - 1) {
            int block = __builtin_ctz(which);
            desk->cut[block * scene->model.shape_count + desk->cuts[block]++] = i;
        }
    }
}

static struct shaft shaft_from(const float centre[3], float radius, const float to_light[3],
                               float q) {
    COUNT(shaft_from, call);
    float size = fabsf(centre[0]) + fabsf(centre[1]) + fabsf(centre[2]);
    return shaft_of(vec_set(centre), vec_set(to_light), radius, v_splat(size), q);
}

void crowd_towards_light(const float centre[3], float radius, const float to_light[3], float q,
                         const struct convex *work) {
    COUNT(crowd_towards_light, call);
    struct shaft shaft = shaft_from(centre, radius, to_light, q);
    struct shapes *shading = &work->desk->shading;
    int count = list_those(&work->scene->tree, in_shaft, &shaft, shading->index);
    shading->count = and_planes(work->scene, shading->index, count);
}

void crowd_about_beam(const float centre[3], float radius, const float to_light[3], float q,
                      const struct convex *work) {
    COUNT(crowd_about_beam, call);
    const struct prepared *scene = work->scene;
    struct desk *desk = work->desk;
    desk->abouts = -1;
    if (radius > scene->tree.spacing)
        return;
    struct shaft shaft = shaft_from(centre, radius, to_light, q);
    int count = list_those(&scene->tree, in_shaft, &shaft, desk->ahead);
    if (count > ABOUT_ROOM)
        return;
    desk->abouts = count;
    for (int k = 0; k < count; k++) {
        const struct placed *s = &scene->placed[desk->ahead[k]];
        for (int i = 0; i < 3; i++)
            desk->about[i][k] = s->position[i];
        desk->about[3][k] = s->bound;
        desk->about_shape[k] = desk->ahead[k];
    }
}

void crowd_about_packet(const float centre[3], float radius, const float to_light[3], float q,
                        const struct convex *work) {
    COUNT(crowd_about_packet, call);
    struct desk *desk = work->desk;
    struct shaft shaft = shaft_from(centre, radius, to_light, q);
    desk->aheads = 0;
    if (desk->abouts < 0) {
        desk->aheads = list_those(&work->scene->tree, in_shaft, &shaft, desk->ahead);
        return;
    }
    for (int first = 0; first < desk->abouts; first += LANES) {
        ACTIVE(lesser(LANES, desk->abouts - first));
        COUNT(crowd_about_packet, spheres);
        struct vec at = {v_load(&desk->about[0][first]), v_load(&desk->about[1][first]),
                         v_load(&desk->about[2][first])};
        unsigned which = v_mask_bits(v_and(in_shaft(at, v_load(&desk->about[3][first]), &shaft),
                                           v_mask_first(desk->abouts - first)));
        for (; which; which &= which - 1)
            desk->ahead[desk->aheads++] = desk->about_shape[first + __builtin_ctz(which)];
    }
}

struct bundle {
    struct vec origin, direction;
    vmask active;
    struct desk *desk;
};

static inline bool met_by_any(const float centre[3], float radius, void *with) {
    COUNT(met_by_any, call);
    COUNT(met_by_any, scalar);
    const struct bundle *b = with;
    struct vec v = {v_splat(centre[0]) - b->origin.x, v_splat(centre[1]) - b->origin.y,
                    v_splat(centre[2]) - b->origin.z};
    vfloat along = vec_dot(v, b->direction), square = vec_dot(v, v);
    vfloat need = v_msub(square, v_splat(1 - 2e-6f), v_splat(radius * radius * (1 + 1e-5f)));
    vmask ahead = v_and(v_cmp_gt(along, v_splat(0.0f)), v_cmp_ge(along * along, need));
    return v_any(v_and(b->active, v_or(ahead, v_cmp_lt(need, v_splat(0.0f)))));
}

static inline void mark_met(int shape, void *with) {
    mark(((struct bundle *)with)->desk, shape);
}

int crowd_along(struct vec origin, struct vec direction, vmask active, const struct convex *work,
                int *list) {
    struct bundle bundle = {origin, direction, active, work->desk};
    follow(&work->scene->tree, met_by_any, mark_met, &bundle);
    mark_planes(work->desk, work->scene);
    return take_marked(work->desk, work->scene, list);
}

// Behind the sphere about all solids no term comes below 1.
static void end_behind_all(struct rays *r, const struct prepared *scene) {
    COUNT(end_behind_all, call);
    COUNT(end_behind_all, scalar);
    const struct tree *tree = &scene->tree;
    float q = scene->known.lit_slope;
    vfloat wide = v_splat(larger(1.0f - q * q, 1e-6f)), zero = v_splat(0.0f);
    struct vec v = {v_splat(tree->centre[0]) - r->point.x, v_splat(tree->centre[1]) - r->point.y,
                    v_splat(tree->centre[2]) - r->point.z};
    vfloat lean = vec_dot(v, r->to_light) + v_splat(q * tree->radius);
    vfloat need = vec_dot(v, v) - v_splat(tree->radius * tree->radius * (1 + 1e-5f));
    vfloat square = v_msub(lean, lean, wide * need);
    vmask met = v_or(v_cmp_lt(need, zero), v_and(v_cmp_gt(lean, zero), v_cmp_ge(square, zero)));
    vfloat leaves = (lean + v_sqrt(v_max(square, zero))) / wide;
    if (!(q < 1.0f)) { // as in look_at_solid()
        met = v_mask_all();
        leaves = v_splat(INFINITY);
    }
    r->end = v_select(met, v_max(leaves, r->end), r->end);
}

// Rays from planes, and where something else can be as near to them as their plane: not before `alone`.
struct leapers {
    struct rays *rays;
    vmask able;
    const struct prepared *scene;
};

static inline vfloat earliest(const float centre[3], float radius, const struct rays *r) {
    COUNT(earliest, call);
    COUNT(earliest, scalar);
    struct vec v = {v_splat(centre[0]) - r->point.x, v_splat(centre[1]) - r->point.y,
                    v_splat(centre[2]) - r->point.z};
    vfloat zero = v_splat(0.0f), square = vec_dot(v, v), c = r->facing;
    vfloat need = v_msub(square, v_splat(1 - 2e-6f), v_splat(radius * radius * (1 + 1e-5f)));
    vfloat lean = v_madd(c, v_splat(radius), vec_dot(v, r->to_light)),
           narrow = v_nmadd(c, c, v_splat(1.0f));
    vfloat rest = v_msub(lean, lean, narrow * need);
    vfloat meets = need / (lean + v_sqrt(v_max(rest, zero)));
    meets = v_select(v_and(v_cmp_gt(lean, zero), v_cmp_ge(rest, zero)), meets, v_splat(INFINITY));
    return v_select(v_cmp_gt(need, zero), meets, zero);
}

static inline bool stops_sooner(const float centre[3], float radius, void *with) {
    COUNT(stops_sooner, call);
    struct leapers *l = with;
    return v_any(v_and(l->able, v_cmp_lt(earliest(centre, radius, l->rays), l->rays->alone)));
}

static inline void stop_at(int shape, void *with) {
    COUNT(stop_at, call);
    struct leapers *l = with;
    const struct placed *s = &l->scene->placed[shape];
    struct rays *r = l->rays;
    r->alone = v_min(r->alone, earliest(s->position, s->bound, r));
}

// Which of the rays meet the solid's bounding sphere sooner than what they enter first; none of those that are from it.
static inline vmask may_enter(const struct placed *s, int i, const struct rays *r) {
    COUNT(may_enter, call);
    COUNT(may_enter, scalar);
    struct vec v = {v_splat(s->position[0]) - r->point.x, v_splat(s->position[1]) - r->point.y,
                    v_splat(s->position[2]) - r->point.z};
    vfloat along = vec_dot(v, r->to_light), square = vec_dot(v, v);
    vfloat need = v_msub(square, v_splat(1 - 2e-6f), v_splat(s->bound * s->bound * (1 + 1e-5f)));
    vmask ahead = v_and(v_cmp_gt(along, v_splat(0.0f)), v_cmp_ge(along * along, need));
    ahead = v_and(ahead,
                  v_cmp_lt(along - v_splat(s->bound * (1 + 1e-4f)), r->first * v_splat(1 + 1e-5f)));
    vmask may = v_or(ahead, v_cmp_lt(need, v_splat(0.0f)));
    return v_andnot(same_shape(r->shape, i), v_and(r->active, may));
}

void crowd_ahead(struct rays *r, struct near *nears, const struct convex *work) {
    ACTIVE(v_count(r->active));
    COUNT(crowd_ahead, call);
    const struct prepared *scene = work->scene;
    for (int k = 0; k < scene->plane_count; k++) {
        COUNT(crowd_ahead, plane);
        r->on_plane = v_or(r->on_plane, same_shape(r->shape, scene->planes[k]));
    }
    for (int k = 0; k < scene->plane_count; k++)
        look_at_plane(&scene->placed[scene->planes[k]], scene->planes[k], r, work,
                      &nears[scene->planes[k]]);
    end_behind_all(r, scene);
    for (int k = 0; k < work->desk->aheads; k++) {
        int i = work->desk->ahead[k];
        ACTIVE(v_count(r->active));
        vmask may = may_enter(&scene->placed[i], i, r);
        if (!v_any(may))
            continue;
        ACTIVE(v_count(may));
        enter_on_the_way(&scene->placed[i], i, r, may);
    }
    ACTIVE(v_count(r->active));
    // A cone's slope must be below 1 for its end to be told (earliest).
    struct leapers l = {
        r, v_and(v_and(r->on_plane, r->active), v_cmp_lt(r->facing, v_splat(0.99f))), scene};
    vmask flat = on_flat_faces(r, scene);
    ACTIVE(v_count(r->active)); // what was called has set its own
    r->alone = v_select(v_or(l.able, flat), r->alone, v_splat(0.0f));
    r->on_plane = v_or(r->on_plane, flat); // as if they were
    if (v_any(l.able))
        follow(&scene->tree, stops_sooner, stop_at, &l);
}
