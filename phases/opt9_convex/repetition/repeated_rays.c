// Rays among the copies of a repeated shape. Every lane walks from cell to cell (J. Amanatides and A. Woo, "A
// fast voxel traversal algorithm for ray tracing", Eurographics 1987) until it meets the box about the copy
// there. When all have met one, or have ended, the closed form is evaluated. Precondition: fits_its_cells()
// in frame/primitives.c.
#include "repetition/repeated_rays.h"
#include "hit/solids.h"
#include "repetition/cell_walk.h"
#include "simd/simd.h"
#include "types/shading_packet.h"

static inline vhalf half_cell_size(vhalf o, vhalf t, vhalf d, vhalf count, double cell) {
    return v_half_nmadd(count, v_half_splat(cell), v_half_madd(t, d, o));
}

// Returns one coordinate of the ray at t = from in the copy's frame, rounded once, at the size of the shape.
static inline vfloat start_beside_copy(vfloat o, vfloat rest, vfloat d, vfloat from,
                                       const struct cell_axis *axis, struct vec_double direction,
                                       const double row[3], double cell) {
    vdouble start = v_double_sum(o, rest), along = v_double_dot(direction, row);
    vfloat count = v_copysign(axis->count, d);
    return v_from_halves(
        half_cell_size(start.low, v_half_low(from), along.low, v_half_low(count), cell),
        half_cell_size(start.high, v_half_high(from), along.high, v_half_high(count), cell));
}

static inline struct vec in_copy_frame(const struct primitive *s, const struct repeated_query *a,
                                       struct vec d, const struct cell_walk *w, vfloat from) {
    vfloat zero = v_splat(0.0f);
    struct vec_double to = {v_double_sum(a->direction.x, zero), v_double_sum(a->direction.y, zero),
                            v_double_sum(a->direction.z, zero)};
    return (struct vec){
        start_beside_copy(a->origin.x, a->rest.x, d.x, from, &w->x, to, s->row[0], s->wide_cell[0]),
        start_beside_copy(a->origin.y, a->rest.y, d.y, from, &w->y, to, s->row[1], s->wide_cell[1]),
        start_beside_copy(a->origin.z, a->rest.z, d.z, from, &w->z, to, s->row[2],
                          s->wide_cell[2])};
}

KERNEL_SHARED vmask enter_cells(const struct primitive *s, const struct repeated_query *among,
                                vfloat *t, struct vec *local) {
    struct vec o = among->origin, d = turned(s, among->direction);
    struct cell_walk w = {cell_axis_of(o.x, d.x, s->cell[0], s->box[0]),
                          cell_axis_of(o.y, d.y, s->cell[1], s->box[1]),
                          cell_axis_of(o.z, d.z, s->cell[2], s->box[2]), among->end};
    vmask found = v_mask_none(), skip = among->leaves;
    *t = v_splat(INFINITY);
    *local = o;
    for (vmask going = among->active; v_any(going); skip = v_mask_none()) {
        vmask met = next_box(&w, going, skip), behind;
        if (!v_any(met))
            break;
        vfloat from = v_max(box_entry(&w), v_splat(0.0f)), in;
        struct vec at;
        vmask entered = enter(in_copy_frame(s, among, d, &w, from), d, s, met, &in, &at, &behind);
        // `from` is rounded and may be just behind the entry.
        entered = v_or(entered, v_and(behind, v_cmp_gt(from, v_splat(0.0f))));
        *t = v_select(entered, from + in, *t);
        *local = vec_select(entered, at, *local);
        found = v_or(found, entered);
        going = next_cells(&w, v_andnot(entered, met));
    }
    return found;
}

static inline vmask in_box(const struct primitive *s, struct vec p) {
    return v_and(
        v_cmp_lt(v_abs(p.x), v_splat(s->box[0])),
        v_and(v_cmp_lt(v_abs(p.y), v_splat(s->box[1])), v_cmp_lt(v_abs(p.z), v_splat(s->box[2]))));
}

static inline vmask is_same_point(struct vec a, struct vec b) {
    vfloat apart = v_abs(a.x - b.x) + v_abs(a.y - b.y) + v_abs(a.z - b.z);
    return v_cmp_ge(v_splat(0.0f), apart);
}

// Wraps the origin *o into the cell about 0 and returns the query. self: rays that start on the shape.
static struct repeated_query repeated_query_of(const struct primitive *s, struct vec *o,
                                               struct vec direction, vmask self, vmask active,
                                               vfloat end) {
    struct vec at = vec_wrapped(s, *o), none = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    self = v_and(self, is_same_point(at, *o)); // a ray that starts in another cell may hit the copy
    *o = at;
    return (struct repeated_query){at, none, direction, active, self, end};
}

KERNEL_SHARED vmask hit_cells(const struct packet_ray *ray, const struct primitive *s, vmask self,
                              vfloat end, float offset, vfloat *t, struct vec *local) {
    struct vec o = to_local(s, ray->origin), d = turned(s, ray->direction);
    if (v_any(self)) {
        struct vec n = normal_on(ray->local, s);
        vmask back = v_cmp_lt(vec_dot(n, d), v_splat(0.0f));
        o = vec_select(self, vec_along(ray->local, n, v_negate_where(back, v_splat(offset))), o);
        self = v_andnot(back, self); // a ray that left from inside hits the shape again
    }
    struct repeated_query among = repeated_query_of(s, &o, ray->direction, self, ray->active, end);
    vmask within = v_and(v_andnot(among.leaves, ray->active), in_box(s, o));
    if (!s->convex) // a torus may occlude itself
        among.leaves = v_mask_none();
    vmask met = enter_cells(s, &among, t, local);
    if (!v_any(within))
        return met;
    vfloat h = distance_at(o, s, v_mask_none());
    vmask inside = v_and(within, v_cmp_lt(h, v_splat(0.0f)));
    *t = v_select(inside, h, *t);
    *local = vec_select(inside, vec_along(o, d, h), *local);
    return v_or(met, inside);
}

KERNEL_SHARED vmask shadow_enters_cells(const struct primitive *s, struct vec origin,
                                        struct vec to_light, vmask self, vmask active, vfloat end,
                                        vfloat *t, struct vec *at) {
    struct repeated_query among = repeated_query_of(s, &origin, to_light, self, active, end);
    return enter_cells(s, &among, t, at);
}

KERNEL_SHARED vmask cells_occlude(const struct primitive *s, struct vec origin,
                                  struct vec direction, vmask self, vmask active, vfloat reach) {
    struct vec o = origin, at;
    vfloat t;
    struct repeated_query among = repeated_query_of(s, &o, direction, self, active, reach);
    vmask within = v_and(v_andnot(s->convex ? among.leaves : v_mask_none(), active), in_box(s, o));
    if (!s->convex)
        among.leaves = v_mask_none();
    vmask blocked = enter_cells(s, &among, &t, &at);
    blocked = v_and(blocked, v_cmp_lt(t, reach));
    if (!v_any(within))
        return blocked;
    return v_or(blocked, v_and(within, v_cmp_lt(distance_at(o, s, v_mask_none()), v_splat(0.0f))));
}
