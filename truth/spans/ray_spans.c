// Builds the intersection of rays with solids from its templates, once in doubles and once in quads.
#include "spans/ray_spans.h"

#include <string.h>

#include "groups/field.h"

enum { MAX_SPANS = 8, MAX_ROOTS = 16, MAX_CELLS = 2000, MAX_ROUNDS = 5000 };

// The smallest interval, relative to the search, that is still split.
static const double RESOLUTION_d = 0x1p-47, RESOLUTION_q = 0x1p-106;

// The order matters: each uses the ones above.
#define BODY "spans/spans_body.h"
#include "number/twice.h"
#define BODY "spans/spans_rounded_body.h"
#include "number/twice.h"
#define BODY "spans/roots_body.h"
#include "number/twice.h"
#define BODY "spans/spans_torus_body.h"
#include "number/twice.h"
#define BODY "spans/group_body.h"
#include "number/twice.h"
#define BODY "spans/first_hit_body.h"
#include "number/twice.h"

struct ivq leave_ball(const struct ray_q *ray, double radius) {
    struct ivq a = norm_sq_q(ray->d), b = dot_q(ray->o, ray->d);
    struct ivq c = sub_q(norm_sq_q(ray->o), square_q(point_q(radius)));
    struct ivq root = sqrt_q(sub_q(square_q(b), mul_q(a, c)));
    return div_q(sub_q(root, b), a);
}
