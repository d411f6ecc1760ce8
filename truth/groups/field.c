// Builds fields of groups from their templates, once in doubles and once in quads.
#include "groups/field.h"

#include <stdlib.h>
#include <string.h>

#include "number/sine.h"

enum { DEEPEST = 256 };

// The order matters: each uses the ones above.
#define BODY "groups/jet_body.h"
#include "number/twice.h"
#define BODY "groups/shapes_body.h"
#include "number/twice.h"
#define BODY "groups/fold_body.h"
#include "number/twice.h"
#define BODY "groups/field_body.h"
#include "number/twice.h"

bool field_surface(const struct solid *group, const struct ivq p[3],
                   const struct material *materials, struct ivq gradient[3],
                   struct material *material) {
    bool sure = false;
    for (int axis = 0; axis < 3; axis++) {
        struct ray_d ray;
        for (int i = 0; i < 3; i++) {
            ray.o[i] = narrow(p[i]);
            ray.d[i] = point_d(i == axis);
        }
        struct field_d *field = field_open_d(group, &ray, false);
        gradient[axis] = (struct ivq){-(quad)INFINITY, (quad)INFINITY};
        if (!field)
            continue;
        field->materials = materials;
        struct term_d term = evaluate_d(field, 0, 0, 0);
        if (!term.jet.rough)
            gradient[axis] = widen(term.jet.slope);
        *material = term.material;
        sure = term.sure;
        field_close_d(field);
    }
    return sure;
}

// Encloses h/t on the piece, and notes the least value that is seen. Returns whether the piece may hold a smaller one.
static bool look(struct field_d *field, struct ivd t, double scale, double *best) {
    double m = mid_d(t), room = 1e-7;
    struct jet_d h = field_over_d(field, t.lo, m, t.hi);
    double here = scale * h.at.hi / m;
    *best = here < *best ? here : *best;
    if (*best <= 0)
        return false;
    struct ivd ratio = div_d(h.over, t);
    if (!h.rough) { // (h/t)' = (h'·t − h)/t²
        struct ivd turn = div_d(sub_d(mul_d(h.slope, t), h.over), square_d(t));
        if (sign_d(turn) != 0) { // the least is at an end
            double end = turn.lo > 0 ? t.lo : t.hi;
            double there = scale * field_over_d(field, end, end, end).at.hi / end;
            *best = there < *best ? there : *best;
            return false;
        }
        struct ivd mean = add_d(div_d(h.at, point_d(m)), mul_d(turn, sub_d(t, point_d(m))));
        ratio.lo = mean.lo > ratio.lo ? mean.lo : ratio.lo;
    }
    return scale * ratio.lo < *best - room;
}

double field_least_ratio(const struct solid *group, const struct ray_d *ray, double start,
                         double end, double strength, double best) {
    enum { DEPTH = 128, ROUNDS = 100000 };
    struct ivd stack[DEPTH] = {{start, end}};
    struct field_d *field = field_open_d(group, ray, true);
    double scale = strength / group->nodes[group->shape->group.root].lipschitz;
    for (int depth = 1, rounds = 0; field && depth > 0 && rounds < ROUNDS && best > 0; rounds++) {
        struct ivd x = stack[--depth];
        double m = mid_d(x);
        if (!look(field, x, scale, &best) || depth + 2 > DEPTH || !(m > x.lo && m < x.hi))
            continue;
        stack[depth++] = (struct ivd){m, x.hi}; // the nearer half comes first
        stack[depth++] = (struct ivd){x.lo, m};
    }
    field_close_d(field);
    return best > 0 ? best : 0;
}
