// See crowd.h. What is asked is the same as of a small scene, first of the spheres about nodes: what those rule out
// they rule out for all in them.
#include "crowd.h"
#include "window.h"

static int lesser(int a, int b) {
    return a < b ? a : b;
}

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

// Which of as many spheres as there are lanes matter.
typedef mask sphere_test(struct vec centre, real radius, const void *with);

__attribute__((always_inline)) static inline void find(const struct tree *tree, sphere_test *test,
                                                       const void *with, struct desk *desk) {
    int waiting[TREE_LEVELS * TREE_WIDTH] = {tree->levels - 1}; // level + TREE_LEVELS·node
    for (int count = 1; count > 0;) {
        int level = waiting[--count] % TREE_LEVELS, node = waiting[count] / TREE_LEVELS;
        const struct spheres *s = &tree->level[level];
        int end = lesser(s->count, (node + 1) * TREE_WIDTH);
        for (int first = node * TREE_WIDTH; first < end; first += LANES) {
            ACTIVE(lesser(LANES, end - first));
            COUNT(find, spheres);
            struct vec centre = {load(s->x + first), load(s->y + first), load(s->z + first)};
            mask matter =
                both(test(centre, load(s->radius + first), with), first_lanes(end - first));
            for (unsigned rest = bits(matter); rest; rest &= rest - 1) {
                int entry = first + __builtin_ctz(rest);
                if (level == 0)
                    mark(desk, tree->shape[entry]);
                else
                    waiting[count++] = level - 1 + TREE_LEVELS * entry;
            }
        }
    }
}

// The same with rays in the lanes, sphere by sphere.
typedef bool ray_test(const float centre[3], float radius, void *with);
typedef void leaf_visit(int shape, void *with);

__attribute__((always_inline)) static inline void follow(const struct tree *tree, ray_test *test,
                                                         leaf_visit *visit, void *with) {
    int waiting[TREE_LEVELS * TREE_WIDTH] = {tree->levels - 1};
    for (int count = 1; count > 0;) {
        int level = waiting[--count] % TREE_LEVELS, node = waiting[count] / TREE_LEVELS;
        const struct spheres *s = &tree->level[level];
        int end = lesser(s->count, (node + 1) * TREE_WIDTH);
        for (int entry = node * TREE_WIDTH; entry < end; entry++) {
            if (!test((float[3]){s->x[entry], s->y[entry], s->z[entry]}, s->radius[entry], with))
                continue;
            if (level == 0)
                visit(tree->shape[entry], with);
            else
                waiting[count++] = level - 1 + TREE_LEVELS * entry;
        }
    }
}

// How much a sphere must be larger for what is rounded in a difference of places.
static inline real blurred(real radius, struct vec v, real reach) {
    real size = absolute(v.x) + absolute(v.y) + absolute(v.z) + reach;
    return mul_add(set(1e-6f), size, radius * set(1 + 1e-5f));
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

static struct vec vec_from(const double a[3]) {
    return (struct vec){set((float)a[0]), set((float)a[1]), set((float)a[2])};
}

static float farthest(const double a[3]) {
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += a[k] < 0 ? -a[k] : a[k];
    return (float)sum;
}

int crowd_in_window(const struct window *w, const struct job *job, struct desk *desk, int *list) {
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
    find(&scene->tree, lies_across, &seen, desk);
    for (int k = 0; k < scene->plane_count; k++)
        if (plane_in_window(w, job->prepared->eyes[scene->planes[k]].centre))
            mark(desk, scene->planes[k]);
    return take_marked(desk, scene, list);
}

struct beam {
    struct vec centre, to_light;
    real radius, reach, q, narrow;
};

static inline mask in_beam(struct vec centre, real radius, const void *with) {
    COUNT(in_beam, call);
    const struct beam *b = with;
    struct vec v = {centre.x - b->centre.x, centre.y - b->centre.y, centre.z - b->centre.z};
    real r = blurred(radius, v, b->reach) + b->radius;
    real lean = mul_add(b->q, r, vec_dot(v, b->to_light));
    real need = neg_mul_add(r, r, vec_dot(v, v));
    mask misses =
        either(less(lean, set(0.0f)), less(lean * lean * set(1 + 1e-4f), b->narrow * need));
    return not_in(both(greater(need, set(0.0f)), misses));
}

int crowd_towards_light(const float centre[3], float radius, const float to_light[3], float q,
                        const struct convex *work, int *list) {
    COUNT(crowd_towards_light, call);
    float size = fabsf(centre[0]) + fabsf(centre[1]) + fabsf(centre[2]);
    struct beam beam = {vec_set(centre), vec_set(to_light),
                        set(radius),     set(size),
                        set(q),          set(q < 1 ? 1 - q * q : 0.0f)};
    find(&work->scene->tree, in_beam, &beam, work->desk);
    mark_planes(work->desk, work->scene);
    return take_marked(work->desk, work->scene, list);
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

// Behind the spheres at the top of the tree, whatever is in them, no term comes below 1.
static void end_behind_all(struct rays *r, const struct prepared *scene) {
    COUNT(end_behind_all, scalar);
    const struct spheres *s = &scene->tree.level[scene->tree.levels - 1];
    float q = scene->lit_slope;
    real wide = set(fmaxf(1.0f - q * q, 1e-6f)), zero = set(0.0f);
    for (int i = 0; i < s->count; i++) {
        COUNT(end_behind_all, sphere);
        COUNT(end_behind_all, radius);
        struct vec v = {set(s->x[i]) - r->point.x, set(s->y[i]) - r->point.y,
                        set(s->z[i]) - r->point.z};
        real lean = vec_dot(v, r->to_light) + set(q * s->radius[i]);
        real need = vec_dot(v, v) - set(s->radius[i] * s->radius[i] * (1 + 1e-5f));
        real square = mul_sub(lean, lean, wide * need);
        mask met = either(less(need, zero), both(greater(lean, zero), not_less(square, zero)));
        real leaves = (lean + root(most_of(square, zero))) / wide;
        r->end = choose(met, most_of(leaves, r->end), r->end);
    }
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

void crowd_ahead(struct rays *r, struct near *nears, const struct convex *work) {
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
    int count = crowd_along(r->point, r->to_light, r->active, work, work->desk->vicinity);
    for (int k = 0; k < count; k++)
        if (scene->placed[work->desk->vicinity[k]].way != LINEAR)
            enter_on_the_way(&scene->placed[work->desk->vicinity[k]], work->desk->vicinity[k], r,
                             r->active);
    // A cone's slope must be below 1 for its end to be told (earliest).
    struct leapers l = {r, both(both(r->on_plane, r->active), less(r->facing, set(0.99f))), scene};
    r->alone = choose(l.able, r->alone, set(0.0f));
    if (any(l.able))
        follow(&scene->tree, stops_sooner, stop_at, &l);
}

// Radius of a vicinity at least, in radii of the nodes above the shapes (4,096 scattered ones at n = 720: 0.3 686 ms, 0.6 737,
// 1 840).
#define VICINITY 0.4f

struct around {
    struct vec centre;
    real within;
};

static inline mask within_reach(struct vec centre, real radius, const void *with) {
    COUNT(within_reach, call);
    const struct around *a = with;
    struct vec v = {centre.x - a->centre.x, centre.y - a->centre.y, centre.z - a->centre.z};
    real r = a->within + radius;
    return less(vec_dot(v, v), r * r);
}

static float picked(mask one, real x) {
    return least_lane(choose(one, x, set(INFINITY)));
}

void crowd_about(const struct rays *r, real t, real h, mask last, struct near *nears,
                 struct vicinity *v, const struct convex *work) {
    COUNT(crowd_about, call);
    COUNT(crowd_about, scalar);
    const struct prepared *scene = work->scene;
    struct vec p = vec_along(r->point, r->to_light, t);
    unsigned lane = bits(last) & (0u - bits(last)); // one of them
    mask one = lanes_of(lane);
    v->centre = (struct vec){set(picked(one, p.x)), set(picked(one, p.y)), set(picked(one, p.z))};
    v->within = fmaxf(1.5f * picked(one, h), VICINITY * scene->tree.spacing);
    float slack = 1e-6f * (float)scene->model.march.bounds_radius;
    struct around around = {v->centre, set(v->within * (1 + 1e-4f) + slack)};
    find(&scene->tree, within_reach, &around, work->desk);
    mark_planes(work->desk, scene);
    v->count = take_marked(work->desk, scene, v->list);
    for (int k = 0; k < v->count; k++) {
        const struct placed *s = &scene->placed[v->list[k]];
        if (s->way == LINEAR) {
            COUNT(crowd_about, plane);
            nears[k].origin.x = drop(same_shape(r->shape, v->list[k]), height_over(s, r->point));
            nears[k].direction.x = vec_dot(vec_set(s->normal), r->to_light);
        } else
            see_along(r, v->list[k], &nears[k], work);
        v->wakes[k] = set(-INFINITY);
    }
}

// Rays ahead of t of which nothing comes nearer than q·t: `ahead` are those of which it is not known.
struct cones {
    const struct rays *rays;
    real t, q, narrow;
    mask asked, blocked;
    real until; // where the last that blocks them is left
    const struct prepared *scene;
};

static inline mask cone_meets(const float centre[3], float radius, const struct cones *c,
                              real *leaves) {
    COUNT(cone_meets, call);
    COUNT(cone_meets, scalar);
    struct vec v = {set(centre[0]) - c->rays->point.x, set(centre[1]) - c->rays->point.y,
                    set(centre[2]) - c->rays->point.z};
    real zero = set(0.0f), square = vec_dot(v, v);
    real need = mul_sub(square, set(1 - 2e-6f), set(radius * radius * (1 + 1e-5f)));
    real lean = mul_add(c->q, set(radius), vec_dot(v, c->rays->to_light));
    real rest = mul_sub(lean, lean, c->narrow * need);
    mask meets = either(less(need, zero), both(greater(lean, zero), not_less(rest, zero)));
    *leaves = (lean + root(most_of(rest, zero))) / c->narrow;
    return both(meets, not_less(*leaves, c->t));
}

static inline bool in_a_cone(const float centre[3], float radius, void *with) {
    struct cones *c = with;
    real leaves;
    return any(but_not(c->blocked, both(c->asked, cone_meets(centre, radius, c, &leaves))));
}

static inline void block(int shape, void *with) {
    COUNT(block, call);
    struct cones *c = with;
    const struct placed *s = &c->scene->placed[shape];
    real leaves;
    mask meets = cone_meets(s->position, s->bound, c, &leaves);
    c->until = choose(meets, most_of(c->until, leaves), c->until);
    c->blocked = either(c->blocked, meets);
}

mask crowd_behind(const struct rays *r, real t, real q, mask asked, real *until,
                  const struct convex *work) {
    COUNT(crowd_behind, call);
    const struct prepared *scene = work->scene;
    q = least_of(q, set(0.99f));
    struct cones c = {r, t, q, neg_mul_add(q, q, set(1.0f)), asked, no_lane(), set(0.0f), scene};
    for (int k = 0; k < scene->plane_count; k++) {
        const struct placed *s = &scene->placed[scene->planes[k]];
        COUNT(crowd_behind, plane);
        real slope = vec_dot(vec_set(s->normal), r->to_light);
        c.blocked = either(c.blocked, less(slope, q));
    }
    c.until = choose(c.blocked, set(INFINITY), c.until);
    if (any(but_not(c.blocked, c.asked)))
        follow(&scene->tree, in_a_cone, block, &c);
    *until = c.until;
    return but_not(c.blocked, c.asked);
}

enum { PLACE_BITS = 5 }; // of each coordinate, in the box of all rays

// The bits of a and two zeros by turns.
static unsigned apart(unsigned a) {
    unsigned code = 0;
    for (int i = 0; i < PLACE_BITS; i++)
        code |= (a >> i & 1u) << (3 * i);
    return code;
}

// One pass of a sort by digits, which keeps what was equal in its order.
static void sort_by(const unsigned short *code, int shift, int count, const unsigned short *from,
                    unsigned short *to) {
    int first[257] = {0};
    for (int i = 0; i < count; i++)
        first[(code[from[i]] >> shift & 255) + 1]++;
    for (int i = 0; i < 256; i++)
        first[i + 1] += first[i];
    for (int i = 0; i < count; i++)
        to[first[code[from[i]] >> shift & 255]++] = from[i];
}

// Morton's order (G. M. Morton, "A computer oriented geodetic data base", IBM 1966).
void crowd_sort(struct desk *desk) {
    int count = desk->shadows;
    for (int i = 0; i < count; i++)
        desk->code[i] = 0;
    for (int k = 0; k < 3; k++) {
        const float *x = desk->shadow[S_POINT + k];
        float least = INFINITY, most = -INFINITY;
        for (int i = 0; i < count; i++) {
            least = fminf(least, x[i]);
            most = fmaxf(most, x[i]);
        }
        float per = most > least ? ((1 << PLACE_BITS) - 0.5f) / (most - least) : 0.0f;
        for (int i = 0; i < count; i++)
            desk->code[i] |= (unsigned short)(apart((unsigned)((x[i] - least) * per)) << k);
    }
    for (int i = 0; i < count; i++)
        desk->order[0][i] = (unsigned short)i;
    sort_by(desk->code, 0, count, desk->order[0], desk->order[1]);
    sort_by(desk->code, 8, count, desk->order[1], desk->order[0]);
}
