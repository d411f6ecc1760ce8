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
    real reach, left, rights, bottom, top, sides[4];
};

static inline mask lies_across(struct vec centre, real radius, const void *with) {
    COUNT(lies_across, call);
    const struct seen *w = with;
    struct vec v = {centre.x - w->eye.x, centre.y - w->eye.y, centre.z - w->eye.z};
    real x = vec_dot(v, w->right), y = vec_dot(v, w->up), z = vec_dot(v, w->ahead);
    real r = blurred(radius, v, w->reach);
    mask in = greater(z, set(0.0f) - r);
    in = both(in, less(mul_sub(w->left, z, x), r * w->sides[0]));
    in = both(in, less(neg_mul_add(w->rights, z, x), r * w->sides[1]));
    in = both(in, less(mul_sub(w->bottom, z, y), r * w->sides[2]));
    return both(in, less(neg_mul_add(w->top, z, y), r * w->sides[3]));
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
    struct seen seen = {vec_from(view->position),
                        vec_from(view->right),
                        vec_from(view->up),
                        vec_from(view->forward),
                        set(farthest(view->position)),
                        set(w->left),
                        set(w->right),
                        set(w->bottom),
                        set(w->top),
                        {root(set(1 + w->left * w->left)), root(set(1 + w->right * w->right)),
                         root(set(1 + w->bottom * w->bottom)), root(set(1 + w->top * w->top))}};
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
    real left = mul_add(lane_numbers(), set(across), set(row->left)), right = left + set(across);
    real left_side = root(mul_add(left, left, set(1.0f))),
         right_side = root(mul_add(right, right, set(1.0f)));
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
            real x = set(c[0]), z = set(c[2]);
            which &= bits(both(less(mul_sub(left, z, x), set(r) * left_side),
                               less(neg_mul_add(right, z, x), set(r) * right_side)));
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
    return shaft_of(vec_set(centre), vec_set(to_light), radius, set(size), q);
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
        struct vec at = {load(&desk->about[0][first]), load(&desk->about[1][first]),
                         load(&desk->about[2][first])};
        unsigned which = bits(both(in_shaft(at, load(&desk->about[3][first]), &shaft),
                                   first_lanes(desk->abouts - first)));
        for (; which; which &= which - 1)
            desk->ahead[desk->aheads++] = desk->about_shape[first + __builtin_ctz(which)];
    }
}

struct bundle {
    struct vec origin, direction;
    mask active;
    struct desk *desk;
};

static inline bool met_by_any(const float centre[3], float radius, void *with) {
    COUNT(met_by_any, call);
    COUNT(met_by_any, scalar);
    const struct bundle *b = with;
    struct vec v = {set(centre[0]) - b->origin.x, set(centre[1]) - b->origin.y,
                    set(centre[2]) - b->origin.z};
    real along = vec_dot(v, b->direction), square = vec_dot(v, v);
    real need = mul_sub(square, set(1 - 2e-6f), set(radius * radius * (1 + 1e-5f)));
    mask ahead = both(greater(along, set(0.0f)), not_less(along * along, need));
    return any(both(b->active, either(ahead, less(need, set(0.0f)))));
}

static inline void mark_met(int shape, void *with) {
    mark(((struct bundle *)with)->desk, shape);
}

int crowd_along(struct vec origin, struct vec direction, mask active, const struct convex *work,
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
    real wide = set(larger(1.0f - q * q, 1e-6f)), zero = set(0.0f);
    struct vec v = {set(tree->centre[0]) - r->point.x, set(tree->centre[1]) - r->point.y,
                    set(tree->centre[2]) - r->point.z};
    real lean = vec_dot(v, r->to_light) + set(q * tree->radius);
    real need = vec_dot(v, v) - set(tree->radius * tree->radius * (1 + 1e-5f));
    real square = mul_sub(lean, lean, wide * need);
    mask met = either(less(need, zero), both(greater(lean, zero), not_less(square, zero)));
    real leaves = (lean + root(most_of(square, zero))) / wide;
    if (!(q < 1.0f)) { // as in look_at_solid()
        met = all_lanes();
        leaves = set(INFINITY);
    }
    r->end = choose(met, most_of(leaves, r->end), r->end);
}

// Rays from planes, and where something else can be as near to them as their plane: not before `alone`.
struct leapers {
    struct rays *rays;
    mask able;
    const struct prepared *scene;
};

static inline real earliest(const float centre[3], float radius, const struct rays *r) {
    COUNT(earliest, call);
    COUNT(earliest, scalar);
    struct vec v = {set(centre[0]) - r->point.x, set(centre[1]) - r->point.y,
                    set(centre[2]) - r->point.z};
    real zero = set(0.0f), square = vec_dot(v, v), c = r->facing;
    real need = mul_sub(square, set(1 - 2e-6f), set(radius * radius * (1 + 1e-5f)));
    real lean = mul_add(c, set(radius), vec_dot(v, r->to_light)),
         narrow = neg_mul_add(c, c, set(1.0f));
    real rest = mul_sub(lean, lean, narrow * need);
    real meets = need / (lean + root(most_of(rest, zero)));
    meets = choose(both(greater(lean, zero), not_less(rest, zero)), meets, set(INFINITY));
    return choose(greater(need, zero), meets, zero);
}

static inline bool stops_sooner(const float centre[3], float radius, void *with) {
    COUNT(stops_sooner, call);
    struct leapers *l = with;
    return any(both(l->able, less(earliest(centre, radius, l->rays), l->rays->alone)));
}

static inline void stop_at(int shape, void *with) {
    COUNT(stop_at, call);
    struct leapers *l = with;
    const struct placed *s = &l->scene->placed[shape];
    struct rays *r = l->rays;
    r->alone = least_of(r->alone, earliest(s->position, s->bound, r));
}

// Which of the rays meet the solid's bounding sphere sooner than what they enter first; none of those that are from it.
static inline mask may_enter(const struct placed *s, int i, const struct rays *r) {
    COUNT(may_enter, call);
    COUNT(may_enter, scalar);
    struct vec v = {set(s->position[0]) - r->point.x, set(s->position[1]) - r->point.y,
                    set(s->position[2]) - r->point.z};
    real along = vec_dot(v, r->to_light), square = vec_dot(v, v);
    real need = mul_sub(square, set(1 - 2e-6f), set(s->bound * s->bound * (1 + 1e-5f)));
    mask ahead = both(greater(along, set(0.0f)), not_less(along * along, need));
    ahead = both(ahead, less(along - set(s->bound * (1 + 1e-4f)), r->first * set(1 + 1e-5f)));
    mask may = either(ahead, less(need, set(0.0f)));
    return but_not(same_shape(r->shape, i), both(r->active, may));
}

void crowd_ahead(struct rays *r, struct near *nears, const struct convex *work) {
    ACTIVE(count_of(r->active));
    COUNT(crowd_ahead, call);
    const struct prepared *scene = work->scene;
    for (int k = 0; k < scene->plane_count; k++) {
        COUNT(crowd_ahead, plane);
        r->on_plane = either(r->on_plane, same_shape(r->shape, scene->planes[k]));
    }
    for (int k = 0; k < scene->plane_count; k++)
        look_at_plane(&scene->placed[scene->planes[k]], scene->planes[k], r, work,
                      &nears[scene->planes[k]]);
    end_behind_all(r, scene);
    for (int k = 0; k < work->desk->aheads; k++) {
        int i = work->desk->ahead[k];
        ACTIVE(count_of(r->active));
        mask may = may_enter(&scene->placed[i], i, r);
        if (!any(may))
            continue;
        ACTIVE(count_of(may));
        enter_on_the_way(&scene->placed[i], i, r, may);
    }
    ACTIVE(count_of(r->active));
    // A cone's slope must be below 1 for its end to be told (earliest).
    struct leapers l = {r, both(both(r->on_plane, r->active), less(r->facing, set(0.99f))), scene};
    mask flat = on_flat_faces(r, scene);
    ACTIVE(count_of(r->active)); // what was called has set its own
    r->alone = choose(either(l.able, flat), r->alone, set(0.0f));
    r->on_plane = either(r->on_plane, flat); // as if they were
    if (any(l.able))
        follow(&scene->tree, stops_sooner, stop_at, &l);
}
