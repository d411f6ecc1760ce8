// Builds the intersection of rays with solids from its templates, once in doubles and once in quads.
// RESOLUTION: the smallest interval, relative to the search, that is still split.
#include "spans/ray_spans.h"

#include <string.h>

#include "groups/field.h"

enum { MAX_SPANS = 8, MAX_ROOTS = 16, MAX_CELLS = 2000, MAX_ROUNDS = 5000 };

#define REAL double
#define IV ivd
#define FN(name) name##_d
#define RESOLUTION 0x1p-47
#include "spans/spans_body.h"

#include "spans/spans_rounded_body.h"

#include "spans/roots_body.h"

#include "spans/spans_torus_body.h"

#include "spans/group_body.h"

#include "spans/first_hit_body.h" // the order matters: each uses the ones above
#undef REAL
#undef IV
#undef FN
#undef RESOLUTION

#define REAL quad
#define IV ivq
#define FN(name) name##_q
#define RESOLUTION ((quad)0x1p-106)
#include "spans/spans_body.h"

#include "spans/spans_rounded_body.h"

#include "spans/roots_body.h"

#include "spans/spans_torus_body.h"

#include "spans/group_body.h"

#include "spans/first_hit_body.h"

struct ivq leave_ball(const struct ray_q *ray, double radius) {
    struct ivq a = norm_sq_q(ray->d), b = dot_q(ray->o, ray->d);
    struct ivq c = sub_q(norm_sq_q(ray->o), square_q(point_q(radius)));
    struct ivq root = sqrt_q(sub_q(square_q(b), mul_q(a, c)));
    return div_q(sub_q(root, b), a);
}
