// The widest cone about a ray that holds nothing of the copies of a repeated solid. In each cell the nearest copy is
// the cell's own (PROOFS.md of opt9_convex, 11.), so the ray is cut at the walls, and each part asks one copy.
#include "shadow/own_solid.h"
#include "shadow/soft_packet.h"
#include "shadow/widest_torus.h"
#include "types/sdf.h"
#include "types/tile_context.h"

// One axis: the ray's coordinate in the first cell, the cells passed, and where the next wall is.
struct cell_line {
    vfloat o, d, per, passed, cell, wall;
};

INLINE struct cell_line cell_line_of(vfloat o, vfloat d, float cell) {
    vfloat per = v_splat(1.0f) / v_copysign(v_max(v_abs(d), v_splat(1e-20f)), d);
    vfloat half = v_copysign(v_splat(0.5f * cell), d);
    vfloat wall = cell > 0.0f ? v_max((half - o) * per, v_splat(0.0f)) : v_splat(INFINITY);
    return (struct cell_line){o, d, per, v_splat(0.0f), v_copysign(v_splat(cell), d), wall};
}

INLINE void pass_wall(struct cell_line *a, vmask going, vfloat t) {
    vmask through = v_and(going, v_cmp_ge(t, a->wall));
    a->passed = a->passed + v_select_or_zero(through, a->cell);
    vfloat half = v_splat(0.5f) * a->cell;
    a->wall = v_select(through, (a->passed + half - a->o) * a->per, a->wall);
}

// Returns the lesser of `best` and the least ratio of the copy in one cell.
INLINE vfloat widest_of_copy(const struct cone_rays *r, const struct primitive *s, vfloat best,
                             vmask active, float room) {
    // The cone of slope `best` may miss the copy's bounding sphere.
    vfloat zero = v_splat(0.0f), along = zero - vec_dot(r->o, r->d), where;
    vfloat c = vec_dot(r->o, r->o) - v_splat(s->bound_sq);
    vfloat b = v_max(v_madd(best, v_splat(s->bound), along), zero);
    vfloat narrow = v_nmadd(best, best, v_splat(1.0f));
    active = v_andnot(v_and(v_cmp_lt(b * b, narrow * c), v_cmp_gt(narrow, zero)), active);
    if (!v_any(active))
        return best;
    if (s->type == SHAPE_SPHERE)
        return widest_sphere(r, s, best, active);
    if (s->convex)
        return widest_convex(r, s, best, active, v_splat(room), &where);
    return widest_torus(r, s, best, active, v_splat(room));
}

vfloat widest_in_cells(int i, const struct soft_packet *w, float room,
                       const struct prepared *scene) {
    const struct primitive *s = &KNOWN(scene)->primitives[i];
    vmask self = v_and(is_shape(w->shape, i), w->active);
    struct vec o = vec_select(self, w->local, to_local(s, w->point)), d = turned(s, w->to_light);
    vfloat best = w->best, near = w->near, far = w->far;
    o = vec_wrapped(s, o);
    vmask here = w->active; // rays whose first cell is still to be asked
    if (v_any(self)) {
        best = v_select(self, v_min(best, own_ratio(s, o, d, near)), best);
        here = v_andnot(self, here);
        if (!s->convex) {
            vfloat square = v_madd(o.x, o.x, o.z * o.z);
            here = v_or(here, v_and(self, v_cmp_lt(square, v_splat(s->a * s->a))));
        }
    }
    struct cell_line x = cell_line_of(o.x, d.x, s->cell[0]);
    struct cell_line y = cell_line_of(o.y, d.y, s->cell[1]);
    struct cell_line z = cell_line_of(o.z, d.z, s->cell[2]);
    vfloat from = near;
    for (vmask going = w->active; v_any(going); here = going) {
        vfloat to = v_min(x.wall, v_min(y.wall, z.wall));
        struct cone_rays r = {
            {o.x - x.passed, o.y - y.passed, o.z - z.passed}, d, from, v_min(to, far)};
        if (!s->convex)
            r.near = v_select(self, v_max(from, v_splat(NEAR_TUBE * s->b)), from);
        vmask asked = v_and(v_and(here, going), v_cmp_lt(r.near, r.far));
        if (v_any(asked))
            best = widest_of_copy(&r, s, best, asked, room);
        from = v_max(from, to);
        going = v_and(going, v_and(v_cmp_lt(to, far), v_cmp_gt(best, v_splat(0.0f))));
        pass_wall(&x, going, to);
        pass_wall(&y, going, to);
        pass_wall(&z, going, to);
        self = v_mask_none();
    }
    return best;
}
