// What rays that go the same way have in common: slopes about an axis, where they begin, and which boxes they may reach
// (trace.c has the sources).
#ifndef PACKETS_FRUSTUM_H
#define PACKETS_FRUSTUM_H

#include "numerics.h"
#include "query.h"

// Slopes of all rays about the axis on which they all go the same way, and where they begin.
struct frustum {
    int axis, side[2]; // and the other two
    bool back;         // along −axis
    float least[2], most[2];
    float lo[3], hi[3]; // of the origins, rounding included
    float steep;        // most of |direction| along the axis
    float far;          // no ray goes further
};

static inline void range_of(const struct beams *b, const float *const field, float *lo, float *hi) {
    COUNT(range_of, call);
    vfloat least = v_splat(INFINITY), most = v_splat(-INFINITY);
    for (int i = 0; i < b->count; i += LANES) {
        COUNT(range_of, packet);
        vmask active = active_in(b, i / LANES);
        vfloat a = v_load(field + i);
        least = v_select(active, v_min(a, least), least);
        most = v_select(active, v_max(a, most), most);
    }
    *lo = least_lane(least);
    *hi = most_lane(most);
}

static inline float most_along(const struct query *q) {
    COUNT(most_along, call);
    vfloat most = v_splat(-INFINITY);
    for (int i = 0; i < q->beams->count; i += LANES) {
        COUNT(most_along, packet);
        most = v_select(active_in(q->beams, i / LANES), v_max(v_load(q->t + i), most), most);
    }
    return larger(most_lane(most), 0.0f);
}

static int solids_in(const struct tree *tree) {
    return tree->hot[SOLID_SPHERE].count + tree->hot[SOLID_BOX].count + tree->hot[SOLID_CONE].count;
}

// Less than this of each direction along the axis, and the slopes about it say little.
static const float STEEPEST = 0.2f;

// False where they have no axis in common, or are no numbers.
static bool frustum_of(const struct query *q, struct frustum *f) {
    COUNT(frustum_of, call);
    const struct beams *b = q->beams;
    float lo[3], hi[3], best = 0;
    for (int k = 0; k < 3; k++) {
        range_of(b, b->direction[k], &lo[k], &hi[k]);
        float sure = lo[k] > 0 ? lo[k] : -hi[k];
        if (sure > best) {
            best = sure;
            f->axis = k;
        }
    }
    if (best < STEEPEST)
        return false;
    COUNT(frustum_of, axis);
    f->back = !(lo[f->axis] > 0);
    f->steep = f->back ? -lo[f->axis] : hi[f->axis];
    f->side[0] = (f->axis + 1) % 3;
    f->side[1] = (f->axis + 2) % 3;
    const struct box *all = &q->scene->tree.bounds;
    float margin = 0, apart = 0;
    for (int k = 0; k < 3; k++) {
        range_of(b, b->origin[k], &f->lo[k], &f->hi[k]);
        margin = larger(margin, larger(fabsf(f->lo[k]), fabsf(f->hi[k])));
        margin = larger(margin, larger(fabsf(all->lo[k]), fabsf(all->hi[k])));
        apart = larger(apart, f->hi[k] - f->lo[k]);
    }
    margin *= 1e-6f;
    if (!(apart < INFINITY && f->steep < 2))
        return false;
    vfloat least[2] = {v_splat(INFINITY), v_splat(INFINITY)},
           most[2] = {v_splat(-INFINITY), v_splat(-INFINITY)};
    for (int i = 0; i < b->count; i += LANES) {
        COUNT(frustum_of, packet);
        vmask active = active_in(b, i / LANES);
        vfloat per = v_splat(1.0f) / v_abs(v_load(b->direction[f->axis] + i));
        for (int k = 0; k < 2; k++) {
            vfloat slope = v_load(b->direction[f->side[k]] + i) * per;
            least[k] = v_select(active, v_min(slope, least[k]), least[k]);
            most[k] = v_select(active, v_max(slope, most[k]), most[k]);
        }
    }
    for (int k = 0; k < 2; k++) {
        f->least[k] = least_lane(least[k]);
        f->most[k] = most_lane(most[k]);
        f->least[k] -= 1e-6f * (1 + fabsf(f->least[k]));
        f->most[k] += 1e-6f * (1 + fabsf(f->most[k]));
    }
    for (int k = 0; k < 3; k++) {
        f->lo[k] -= margin;
        f->hi[k] += margin;
    }
    f->far = most_along(q);
    return true;
}

// Solids that the frustum is expected to hold: as many of all as it is of the tree's box across, at its far end.
static float crowd_in(const struct query *q, const struct frustum *f) {
    COUNT(crowd_in, call);
    const struct tree *tree = &q->scene->tree;
    const struct box *all = &tree->bounds;
    int k = f->axis;
    float reach = f->back ? f->hi[k] - all->lo[k] : all->hi[k] - f->lo[k];
    float crowd = (float)solids_in(tree);
    for (int side = 0; side < 2; side++) {
        int u = f->side[side];
        float across = (f->most[side] - f->least[side]) * larger(reach, 0) + f->hi[u] - f->lo[u];
        crowd *= smaller(across / larger(all->hi[u] - all->lo[u], 1e-30f), 1);
    }
    return crowd;
}

// Boxes that the frustum may reach before `far`, and how far along its axis they begin.
static inline vmask reached(const struct frustum *f, const vfloat lo[3], const vfloat hi[3],
                            vfloat *begin) {
    COUNT(reached, call);
    COUNT(reached, scalar);
    int k = f->axis;
    vfloat zero = v_splat(0.0f), first, last;
    if (f->back) {
        first = v_splat(f->lo[k]) - hi[k];
        last = v_splat(f->hi[k]) - lo[k];
    } else {
        first = lo[k] - v_splat(f->hi[k]);
        last = hi[k] - v_splat(f->lo[k]);
    }
    first = v_max(first, zero);
    vmask in = v_and(v_cmp_ge(last, zero), v_cmp_ge(v_splat(f->far * f->steep), first));
    for (int side = 0; side < 2; side++) {
        int u = f->side[side];
        vfloat top = v_max(v_splat(f->most[side]) * first, v_splat(f->most[side]) * last) +
                     v_splat(f->hi[u]);
        vfloat low = v_min(v_splat(f->least[side]) * first, v_splat(f->least[side]) * last) +
                     v_splat(f->lo[u]);
        in = v_and(in, v_and(v_cmp_ge(top, lo[u]), v_cmp_ge(hi[u], low)));
    }
    *begin = first;
    return in;
}

// One box, as reached() has it.
static bool cell_reached(const struct frustum *f, const struct box *cell) {
    COUNT(cell_reached, call);
    int k = f->axis;
    float first = f->back ? f->lo[k] - cell->hi[k] : cell->lo[k] - f->hi[k];
    float last = f->back ? f->hi[k] - cell->lo[k] : cell->hi[k] - f->lo[k];
    first = larger(first, 0);
    bool in = last >= 0 && f->far * f->steep >= first;
    for (int side = 0; side < 2; side++) {
        int u = f->side[side];
        float top = larger(f->most[side] * first, f->most[side] * last) + f->hi[u];
        float low = smaller(f->least[side] * first, f->least[side] * last) + f->lo[u];
        in = in && top >= cell->lo[u] && cell->hi[u] >= low;
    }
    return in;
}

#endif
