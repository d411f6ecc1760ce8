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

static int and_planes(const struct prepared *scene, int *list, int count) {
    for (int k = 0; k < scene->plane_count; k++)
        list[count++] = scene->planes[k];
    return count;
}

// Which of as many spheres as there are lanes matter.
typedef mask sphere_test(struct vec centre, real radius, const void *with);

// Those go to `list`, in no order; how many.
__attribute__((always_inline)) static inline int
list_those(const struct tree *tree, sphere_test *test, const void *with, int *list) {
    int listed = 0;
    int waiting[TREE_LEVELS * TREE_WIDTH] = {tree->levels - 1}; // level + TREE_LEVELS·node
    for (int count = 1; count > 0;) {
        int level = waiting[--count] % TREE_LEVELS, node = waiting[count] / TREE_LEVELS;
        const struct spheres *s = &tree->level[level];
        int end = lesser(s->count, (node + 1) * TREE_WIDTH);
        for (int first = node * TREE_WIDTH; first < end; first += LANES) {
            ACTIVE(lesser(LANES, end - first));
            COUNT(list_those, spheres);
            struct vec centre = {load(s->x + first), load(s->y + first), load(s->z + first)};
            mask matter =
                both(test(centre, load(s->radius + first), with), first_lanes(end - first));
            for (unsigned rest = bits(matter); rest; rest &= rest - 1) {
                int entry = first + __builtin_ctz(rest);
                if (level == 0)
                    list[listed++] = tree->shape[entry];
                else
                    waiting[count++] = level - 1 + TREE_LEVELS * entry;
            }
        }
    }
    return listed;
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
    int count = list_those(&scene->tree, lies_across, &seen, list);
    for (int k = 0; k < count; k++)
        mark(desk, list[k]);
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
    int count = list_those(&work->scene->tree, in_beam, &beam, list);
    return and_planes(work->scene, list, count);
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
// 1 840), and beside the distance that the nearest shape is no further than.
#define VICINITY 0.4f
#define WIDER 1.2f
// How far ahead of the ray behind all others its centre is, as a share of what leaves that one a step: all of them go on.
#define AHEAD 0.6f

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

// From a point, the same in all lanes, to the solid's bounding sphere.
static inline float distance_from(const struct placed *s, struct vec point) {
    COUNT(distance_from, call);
    float x = s->position[0] - first_of(point.x), y = s->position[1] - first_of(point.y),
          z = s->position[2] - first_of(point.z);
    return sqrtf(x * x + y * y + z * z) * (1 - 1e-5f) - s->bound;
}

void crowd_about(const struct rays *r, real t, real h, mask last, struct near *nears,
                 struct vicinity *v, const struct convex *work) {
    COUNT(crowd_about, call);
    COUNT(crowd_about, scalar);
    const struct prepared *scene = work->scene;
    struct vec p = vec_along(r->point, r->to_light, t);
    unsigned lane = bits(last) & (0u - bits(last)); // one of them
    mask one = lanes_of(lane);
    float near = picked(one, h);
    v->within = fmaxf(WIDER * near, VICINITY * scene->tree.spacing);
    float slack = 1e-6f * (float)scene->model.march.bounds_radius;
    float on = fmaxf(AHEAD * (v->within - near) - 2 * slack, 0.0f); // it must not wait itself
    struct vec ahead = vec_along(p, r->to_light, set(on));
    v->centre = (struct vec){set(picked(one, ahead.x)), set(picked(one, ahead.y)),
                             set(picked(one, ahead.z))};
    v->room = v->within - 0.4f * near;
    struct around around = {v->centre, set(v->within * (1 + 1e-4f) + slack)};
    v->count = and_planes(scene, v->list, list_those(&scene->tree, within_reach, &around, v->list));
    float nearest = INFINITY;
    v->recent = 0;
    real nearer = t - distance_between(p, v->centre);
    for (int k = 0; k < v->count; k++) {
        const struct placed *s = &scene->placed[v->list[k]];
        if (s->way == LINEAR) {
            COUNT(crowd_about, plane);
            nears[k].origin.x = drop(same_shape(r->shape, v->list[k]), height_over(s, r->point));
            nears[k].direction.x = vec_dot(vec_set(s->normal), r->to_light);
            v->wakes[k] = set(-INFINITY);
            continue;
        }
        see_along(r, v->list[k], &nears[k], work);
        // A ray is no nearer to it than the vicinity's centre, but for what is between them.
        COUNT(crowd_about, solid);
        COUNT(crowd_about, solid_scalar);
        float far = distance_from(s, v->centre) - slack;
        v->wakes[k] = set(far) + nearer;
        v->recent = far < nearest ? k : v->recent;
        nearest = fminf(nearest, far);
    }
}

// A ray of which it is asked whether anything ahead of t comes nearer than q·t, the spheres in the lanes.
struct cone_of_one {
    struct vec point, to_light;
    real q, narrow, ahead; // narrow: 1 − q²; ahead: narrow·t
};

static inline mask in_its_way(const struct cone_of_one *c, struct vec centre, real radius,
                              real *lean, real *rest) {
    COUNT(in_its_way, call);
    real zero = set(0.0f);
    struct vec v = {centre.x - c->point.x, centre.y - c->point.y, centre.z - c->point.z};
    real square = vec_dot(v, v);
    real need = mul_sub(square, set(1 - 2e-6f), radius * radius * set(1 + 1e-5f));
    *lean = mul_add(c->q, radius, vec_dot(v, c->to_light));
    *rest = mul_sub(*lean, *lean, c->narrow * need);
    mask meets = either(less(need, zero), both(greater(*lean, zero), not_less(*rest, zero)));
    real over = c->ahead - *lean; // it is left at (lean + √rest)/narrow
    return both(meets, either(less(over, zero), not_less(*rest, over * over)));
}

// Leaves of the tree other than the shape `own`.
static mask of_others(const struct tree *tree, int first, mask which, int own) {
    unsigned others = bits(which);
    for (unsigned rest = others; rest; rest &= rest - 1)
        if (tree->shape[first + __builtin_ctz(rest)] == own)
            others &= ~(rest & (0u - rest));
    return lanes_of(others);
}

// Which of the entries from `first` on the cone meets.
static inline mask met_in_node(const struct tree *tree, const struct cone_of_one *cone, int level,
                               int first, int end, int own, real *lean, real *rest) {
    ACTIVE(lesser(LANES, end - first));
    COUNT(met_in_node, call);
    const struct spheres *s = &tree->level[level];
    struct vec centre = {load(s->x + first), load(s->y + first), load(s->z + first)};
    mask meets = both(in_its_way(cone, centre, load(s->radius + first), lean, rest),
                      first_lanes(end - first));
    return level == 0 && own >= 0 && any(meets) ? of_others(tree, first, meets, own) : meets;
}

static float last_left(mask meets, real lean, real rest, const struct cone_of_one *cone) {
    COUNT(last_left, call);
    real leaves = (lean + root(most_of(rest, set(0.0f)))) / cone->narrow;
    return -least_lane(choose(meets, set(0.0f) - leaves, set(INFINITY)));
}

// Where the last of some that the cone meets is left: those of one row of lanes, the furthest it happens upon. −1: it meets
// nothing. *row: what the ray before it met, which is likely to be in this one's way too.
static float way_ends(const struct tree *tree, const struct cone_of_one *cone, int own, int *row) {
    COUNT(way_ends, call);
    real lean, rest;
    int leaves = tree->level[0].count;
    if (*row >= 0) {
        COUNT(way_ends, row);
        mask meets = met_in_node(tree, cone, 0, *row, leaves, own, &lean, &rest);
        if (any(meets))
            return last_left(meets, lean, rest, cone);
    }
    int waiting[TREE_LEVELS * TREE_WIDTH] = {tree->levels - 1}; // level + TREE_LEVELS·node
    for (int count = 1; count > 0;) {
        int level = waiting[--count] % TREE_LEVELS, node = waiting[count] / TREE_LEVELS;
        int end = lesser(tree->level[level].count, (node + 1) * TREE_WIDTH);
        for (int first = node * TREE_WIDTH; first < end; first += LANES) {
            mask meets = met_in_node(tree, cone, level, first, end, own, &lean, &rest);
            unsigned which = bits(meets);
            if (!which)
                continue;
            if (level == 0) {
                *row = first;
                return last_left(meets, lean, rest, cone);
            }
            // The furthest is looked into first: what is in the way there is so for long.
            COUNT(way_ends, nodes);
            real order = choose(meets, set(0.0f) - lean, set(INFINITY));
            unsigned last = bits(not_less(set(least_lane(order)), order)) & which;
            last &= 0u - last;
            for (which &= ~last; which; which &= which - 1)
                waiting[count++] = level - 1 + TREE_LEVELS * (first + __builtin_ctz(which));
            waiting[count++] = level - 1 + TREE_LEVELS * (first + __builtin_ctz(last));
        }
    }
    return -1;
}

// Of each lane asked, for its own cone; −1 where nothing is met. own: shapes that do not count, or −1.
static real ways_end(const struct tree *tree, struct vec point, struct vec to_light, real t, real q,
                     real own, mask asked) {
    COUNT(ways_end, call);
    float lanes[9][LANES], until[LANES] = {0};
    const real of[9] = {point.x, point.y, point.z, to_light.x, to_light.y, to_light.z, t, q, own};
    for (int i = 0; i < 9; i++)
        unload(of[i], lanes[i]);
    int row = -1;
    for (unsigned rest = bits(asked); rest; rest &= rest - 1) {
        COUNT(ways_end, ray);
        int i = __builtin_ctz(rest);
        float narrow = 1 - lanes[7][i] * lanes[7][i];
        struct cone_of_one cone = {{set(lanes[0][i]), set(lanes[1][i]), set(lanes[2][i])},
                                   {set(lanes[3][i]), set(lanes[4][i]), set(lanes[5][i])},
                                   set(lanes[7][i]),
                                   set(narrow),
                                   set(narrow * lanes[6][i])};
        until[i] = way_ends(tree, &cone, (int)lanes[8][i], &row);
    }
    return load(until);
}

mask crowd_behind(const struct rays *r, real t, real q, mask asked, real *until,
                  const struct convex *work) {
    COUNT(crowd_behind, call);
    const struct prepared *scene = work->scene;
    q = least_of(q, set(0.99f));
    mask blocked = no_lane();
    for (int k = 0; k < scene->plane_count; k++) {
        const struct placed *s = &scene->placed[scene->planes[k]];
        COUNT(crowd_behind, plane);
        real slope = vec_dot(vec_set(s->normal), r->to_light);
        blocked = either(blocked, less(slope, q));
    }
    asked = but_not(blocked, asked);
    real ends = ways_end(&scene->tree, r->point, r->to_light, t, q, set(-1.0f), asked);
    *until = choose(blocked, set(INFINITY), ends);
    return both(asked, less(ends, set(0.0f)));
}

mask crowd_clears(struct vec point, struct vec local, struct vec to_light, real facing, real shape,
                  mask active, const struct convex *work) {
    ACTIVE(count_of(active));
    COUNT(crowd_clears, call);
    const struct prepared *scene = work->scene;
    float q = scene->lit_slope;
    mask clear = active;
    for (int k = 0; k < scene->plane_count; k++) {
        int i = scene->planes[k];
        COUNT(crowd_clears, plane);
        mask here = plane_clears(height_over(&scene->placed[i], point),
                                 vec_dot(vec_set(scene->placed[i].normal), to_light), q, scene);
        clear = both(clear, either(same_shape(shape, i), here));
    }
    float id[LANES];
    unload(shape, id);
    for (unsigned rest = bits(clear); rest;) { // once for each shape that they are on
        int i = (int)id[__builtin_ctz(rest)];
        mask same = both(lanes_of(rest), same_shape(shape, i));
        COUNT(crowd_clears, shape);
        rest &= ~bits(same);
        if (scene->placed[i].way != LINEAR)
            clear = but_not(but_not(bulges(&scene->placed[i], local, facing, scene), same), clear);
    }
    if (!any(clear) || q >= 0.99f)
        return no_lane();
    COUNT(crowd_clears, asked);
    real ends = ways_end(&scene->tree, point, to_light, set(0.0f), set(q), shape, clear);
    return both(clear, less(ends, set(0.0f)));
}

enum { PLACE_BITS = 5, BEHIND = 1 << 15 }; // of each coordinate, in the box of all rays

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

// Rays from one solid are a beam: those of a packet are from one as far as there are enough, in the tree's order. Rays
// from planes behind them, by Morton's order (G. M. Morton, "A computer oriented geodetic data base", IBM 1966).
void crowd_sort(struct desk *desk, const struct prepared *scene) {
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
    for (int i = 0; i < count; i++) {
        const struct placed *s = &scene->placed[(int)desk->shadow[S_SHAPE][i]];
        desk->code[i] = (unsigned short)(s->way == LINEAR ? desk->code[i] | BEHIND : s->rank);
        desk->order[0][i] = (unsigned short)i;
    }
    sort_by(desk->code, 0, count, desk->order[0], desk->order[1]);
    sort_by(desk->code, 8, count, desk->order[1], desk->order[0]);
}
