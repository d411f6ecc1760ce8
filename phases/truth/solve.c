// The solver, once in doubles and once in quads.
#include "solve.h"

#include <string.h>

enum { MOST_PARTS = 8, MOST_ROOTS = 16, MOST_CELLS = 2000, MOST_ROUNDS = 5000 };

#define REAL double
#define IV ivd
#define FN(name) name##_d
#define FINE 0x1p-47
#include "solve_body.h"

#include "rounded_body.h"

#include "torus_body.h"

#include "first_body.h" // in this order
#undef REAL
#undef IV
#undef FN
#undef FINE

#define REAL quad
#define IV ivq
#define FN(name) name##_q
#define FINE ((quad)0x1p-106)
#include "solve_body.h"

#include "rounded_body.h"

#include "torus_body.h"

#include "first_body.h"

struct ivq leave_ball(const struct ray_q *ray, double radius) {
    struct ivq a = square_q(ray->d), b = dot_q(ray->o, ray->d);
    struct ivq c = sub_q(square_q(ray->o), sqr_q(point_q(radius)));
    struct ivq root = root_q(sub_q(sqr_q(b), mul_q(a, c)));
    return div_q(sub_q(root, b), a);
}
