// Packets of pixels: eight neighbours of a row, one ray through the centre of each, and how they are stored.
#include <stdlib.h>

#include "phase.h"
#include "trace.h"

struct vec vec_from_doubles(const double a[3]) {
    return (struct vec){v_splat((float)a[0]), v_splat((float)a[1]), v_splat((float)a[2])};
}

// A point of the world as sums of two floats, the same in all lanes.
struct point point_from_doubles(const double a[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(a[i], &hi[i], &lo[i]);
    return (struct point){vec_set(hi), vec_set(lo)};
}

// Unit directions of the rays through the centres of eight pixels of a row.
struct vec get_direction(int column, int row, const struct frame *frame, const struct view *view) {
    COUNT(get_direction, call);
    COUNT(get_direction, scalar);
    double pixel_size = view->tan_half_fov / frame->height;
    float first = (float)(2.0 * column + 1.0 - frame->width); // an integer, so it is exact
    vfloat columns = v_splat(first) + _mm256_setr_ps(0, 2, 4, 6, 8, 10, 12, 14);
    vfloat x = columns * v_splat((float)pixel_size);
    vfloat y = v_splat((float)((frame->height - 1.0 - 2.0 * row) * pixel_size));
    struct vec d = vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), x);
    d = vec_along(d, vec_from_doubles(view->up), y);
    return vec_scale(d, v_splat(1.0f) / vec_norm(d));
}

// Writes the first `count` lanes, one every `stride` floats.
static void store_plane(float *plane, int stride, int count, vfloat values) {
    float lanes[LANES];
    _mm256_storeu_ps(lanes, values);
    for (int lane = 0; lane < count; lane++)
        plane[lane * stride] = lanes[lane];
}

void store(struct frame *frame, size_t pixel, int count, const struct shaded *seen) {
    COUNT(store, call);
    float *rgb = frame->rgb + 3 * pixel;
    store_plane(rgb, 3, count, seen->color.x);
    store_plane(rgb + 1, 3, count, seen->color.y);
    store_plane(rgb + 2, 3, count, seen->color.z);
    if (!frame->depth)
        return;
    const struct hit *hit = &seen->hit;
    float *normal = frame->normal + 3 * pixel;
    store_plane(frame->depth + pixel, 1, count, v_select(hit->found, hit->t, v_splat(INFINITY)));
    store_plane(frame->id + pixel, 1, count, hit->shape);
    store_plane(normal, 3, count, hit->normal.x);
    store_plane(normal + 1, 3, count, hit->normal.y);
    store_plane(normal + 2, 3, count, hit->normal.z);
    store_plane(frame->evals + pixel, 1, count, hit->evals);
}

// The first `count` lanes.
vmask v_mask_first(int count) {
    return v_cmp_lt(_mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7), v_splat((float)count));
}

struct local_ray *new_local_rays(const struct prepared *prepared) {
    return aligned_alloc(32, (size_t)prepared->model.shape_count * sizeof(struct local_ray));
}
