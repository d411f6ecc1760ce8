// Lists of shapes from the BVH. The tests are those of a scene without a BVH, first on the spheres of nodes.
#include "bvh/bvh_lists.h"
#include "bvh/bvh_traversal.h"
#include "hit/tile_frustum.h"

static int list_marked(struct worker_scratch *scratch, const struct prepared *scene, int *list) {
    int count = 0;
    for (int word = 0; word <= (scene->model.shape_count - 1) / 64; word++) {
        for (unsigned long long rest = scratch->marks[word]; rest; rest &= rest - 1)
            list[count++] = word * 64 + __builtin_ctzll(rest);
        scratch->marks[word] = 0;
    }
    return count;
}

static inline void mark(struct worker_scratch *scratch, int shape) {
    scratch->marks[shape / 64] |= 1ull << shape % 64;
}

static void mark_planes(struct worker_scratch *scratch, const struct prepared *scene) {
    for (int k = 0; k < scene->plane_count; k++)
        mark(scratch, scene->planes[k]);
}

struct frustum_query {
    struct vec eye, right, up, ahead;
    vfloat reach, left, rights, bottom, top, sides[4];
};

static inline vmask sphere_in_frustum(struct vec centre, vfloat radius, const void *with) {
    const struct frustum_query *w = with;
    struct vec v = vec_sub(centre, w->eye);
    vfloat x = vec_dot(v, w->right), y = vec_dot(v, w->up), z = vec_dot(v, w->ahead);
    vfloat r = radius_with_rounding(radius, v, w->reach);
    vmask in = v_cmp_gt(z, v_splat(0.0f) - r);
    in = v_and(in, v_cmp_lt(v_msub(w->left, z, x), r * w->sides[0]));
    in = v_and(in, v_cmp_lt(v_nmadd(w->rights, z, x), r * w->sides[1]));
    in = v_and(in, v_cmp_lt(v_msub(w->bottom, z, y), r * w->sides[2]));
    return v_and(in, v_cmp_lt(v_nmadd(w->top, z, y), r * w->sides[3]));
}

static float manhattan_length(const double a[3]) {
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += a[k] < 0 ? -a[k] : a[k];
    return (float)sum;
}

void bvh_list_in_frustum(const struct tile_frustum *w, const struct job *job,
                         struct worker_scratch *scratch) {
    const struct prepared *scene = job->prepared;
    const struct view *view = job->view;
    struct frustum_query seen = {
        vec_from_doubles(view->position),
        vec_from_doubles(view->right),
        vec_from_doubles(view->up),
        vec_from_doubles(view->forward),
        v_splat(manhattan_length(view->position)),
        v_splat(w->left),
        v_splat(w->right),
        v_splat(w->bottom),
        v_splat(w->top),
        {v_sqrt(v_splat(1 + w->left * w->left)), v_sqrt(v_splat(1 + w->right * w->right)),
         v_sqrt(v_splat(1 + w->bottom * w->bottom)), v_sqrt(v_splat(1 + w->top * w->top))}};
    scratch->far = scratch->leaf = -1;
    int *list = scratch->camera_shapes.index,
        count = bvh_list(&scene->bvh, sphere_in_frustum, &seen, list);
    for (int k = 0; k < count; k++)
        mark(scratch, list[k]);
    for (int k = 0; k < scene->plane_count; k++)
        if (plane_in_frustum(w, job->prepared->cameras[scene->planes[k]].centre))
            mark(scratch, scene->planes[k]);
    scratch->camera_shapes.count = list_marked(scratch, scene, list);
}

// One lane per block. The margin of the sphere is larger than the rounding of a camera ray.
void bvh_list_in_row(const struct tile_frustum *row, float across, const struct job *job,
                     struct worker_scratch *scratch) {
    _Static_assert((int)GROUP <= (int)LANES, "a lane for each");
    vfloat left = v_madd(v_iota(), v_splat(across), v_splat(row->left)),
           right = left + v_splat(across);
    vfloat left_side = v_sqrt(v_madd(left, left, v_splat(1.0f))),
           right_side = v_sqrt(v_madd(right, right, v_splat(1.0f)));
    float bottom = sqrtf(1 + row->bottom * row->bottom), top = sqrtf(1 + row->top * row->top);
    for (int k = 0; k < GROUP; k++)
        scratch->row_counts[k] = 0;
    const struct prepared *scene = job->prepared;
    const int *list = scratch->camera_shapes.index, count = scratch->camera_shapes.count;
    for (int k = 0; k < count; k++) {
        int i = list[k];
        const struct primitive *s = &scene->primitives[i];
        const float *c = job->cameras[i].centre;
        unsigned which = (1u << GROUP) - 1;
        if (s->eval != EVAL_LINEAR) {
            float r = s->bound * (1 + 1e-5f) + 1e-6f * (fabsf(c[0]) + fabsf(c[1]) + fabsf(c[2]));
            // `|` asks for both comparisons without a branch; gcc 12 still branches.
            if ((row->bottom * c[2] - c[1] > r * bottom) | (c[1] - row->top * c[2] > r * top))
                continue;
            vfloat x = v_splat(c[0]), z = v_splat(c[2]);
            which &= v_mask_bits(v_and(v_cmp_lt(v_msub(left, z, x), v_splat(r) * left_side),
                                       v_cmp_lt(v_nmadd(right, z, x), v_splat(r) * right_side)));
        }
        for (; which; which &= which - 1) {
            int block = __builtin_ctz(which);
            scratch->row_list[block * scene->model.shape_count + scratch->row_counts[block]++] = i;
        }
    }
}

// A cone about a bundle of rays that start in a ball. q = ∞: all of space.
struct bundle_cone {
    struct vec centre, to_light;
    vfloat radius, reach, q, a; // a: 1 − q²
};

static inline vmask sphere_in_bundle_cone(struct vec centre, vfloat radius, const void *with) {
    const struct bundle_cone *cone = with;
    struct vec v = vec_sub(centre, cone->centre);
    vfloat r = radius_with_rounding(radius, v, cone->reach) + cone->radius;
    vfloat b = v_madd(cone->q, r, vec_dot(v, cone->to_light));
    vfloat c = v_nmadd(r, r, vec_dot(v, v));
    vmask misses =
        v_or(v_cmp_lt(b, v_splat(0.0f)), v_cmp_lt(b * b * v_splat(1 + 1e-4f), cone->a * c));
    return v_not(v_and(v_cmp_gt(c, v_splat(0.0f)), misses));
}

// A cone of slope 1 or more also meets shapes behind its rays: nothing is left out then.
static struct bundle_cone bundle_cone_of(const struct light_bundle *bundle, float q) {
    const float *c = bundle->centre;
    bool wide = !(q < 1);
    return (struct bundle_cone){vec_set(c),
                                vec_set(bundle->to_light),
                                v_splat(bundle->radius),
                                v_splat(fabsf(c[0]) + fabsf(c[1]) + fabsf(c[2])),
                                v_splat(wide ? INFINITY : q),
                                v_splat(wide ? 0 : 1 - q * q)};
}

void bvh_list_towards_light(const struct light_bundle *bundle, float q,
                            const struct tile_context *work) {
    struct bundle_cone shaft = bundle_cone_of(bundle, q + bundle->spread);
    struct shape_set *shading = &work->scratch->occluders;
    int count = bvh_list(&work->scene->bvh, sphere_in_bundle_cone, &shaft, shading->index);
    shading->count = append_planes(work->scene, shading->index, count);
}

void bvh_list_for_batch(const struct light_bundle *bundle, const struct tile_context *work) {
    const struct prepared *scene = work->scene;
    struct worker_scratch *scratch = work->scratch;
    scratch->batch_count = -1;
    if (bundle->radius > scene->bvh.spacing)
        return;
    struct bundle_cone shaft = bundle_cone_of(bundle, bundle->spread);
    int count = bvh_list(&scene->bvh, sphere_in_bundle_cone, &shaft, scratch->entry_list);
    if (count > BATCH_CANDIDATES_ROOM)
        return;
    scratch->batch_count = count;
    for (int k = 0; k < count; k++) {
        const struct primitive *s = &scene->primitives[scratch->entry_list[k]];
        for (int i = 0; i < 3; i++)
            scratch->batch_sphere[i][k] = s->position[i];
        scratch->batch_sphere[3][k] = s->bound;
        scratch->batch_shape[k] = scratch->entry_list[k];
    }
}

void bvh_list_for_packet(const struct light_bundle *bundle, const struct tile_context *work) {
    struct worker_scratch *scratch = work->scratch;
    struct bundle_cone shaft = bundle_cone_of(bundle, bundle->spread);
    scratch->entries = 0;
    if (scratch->batch_count < 0) {
        scratch->entries =
            bvh_list(&work->scene->bvh, sphere_in_bundle_cone, &shaft, scratch->entry_list);
        return;
    }
    for (int first = 0; first < scratch->batch_count; first += LANES) {
        struct vec at = {v_load(&scratch->batch_sphere[0][first]),
                         v_load(&scratch->batch_sphere[1][first]),
                         v_load(&scratch->batch_sphere[2][first])};
        unsigned which = v_mask_bits(
            v_and(sphere_in_bundle_cone(at, v_load(&scratch->batch_sphere[3][first]), &shaft),
                  v_mask_first(scratch->batch_count - first)));
        for (; which; which &= which - 1)
            scratch->entry_list[scratch->entries++] =
                scratch->batch_shape[first + __builtin_ctz(which)];
    }
}

struct packet_query {
    struct vec origin, direction;
    vmask active;
    struct worker_scratch *scratch;
};

static inline bool sphere_met_by_ray(const float centre[3], float radius, void *with) {
    const struct packet_query *rays = with;
    struct vec v = vec_sub(vec_set(centre), rays->origin);
    vfloat along = vec_dot(v, rays->direction), square = vec_dot(v, v);
    vfloat c = v_msub(square, v_splat(1 - 2e-6f), v_splat(radius * radius * (1 + 1e-5f)));
    vmask ahead = v_and(v_cmp_gt(along, v_splat(0.0f)), v_cmp_ge(along * along, c));
    return v_any(v_and(rays->active, v_or(ahead, v_cmp_lt(c, v_splat(0.0f)))));
}

static inline void mark_leaf(int shape, void *with) {
    mark(((struct packet_query *)with)->scratch, shape);
}

int bvh_list_along(struct vec origin, struct vec direction, vmask active,
                   const struct tile_context *work, int *list) {
    struct packet_query bundle = {origin, direction, active, work->scratch};
    bvh_visit(&work->scene->bvh, sphere_met_by_ray, mark_leaf, &bundle);
    mark_planes(work->scratch, work->scene);
    return list_marked(work->scratch, work->scene, list);
}
