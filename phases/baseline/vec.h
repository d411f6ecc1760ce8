// A vector is a struct of three doubles, passed and returned by value through calls that are not
// inlined. A call costs what it costs in the paper's program, and no more: there the vector functions
// share a source file, so that gcc inlines new_vector and vec_dot into them.
#pragma once

#include <math.h>

#include "counting/flops.h"

// A call must stay a call: that is the point of this phase. gcc would still clone a noinline function
// for its arguments, which noipa forbids. clang lacks noipa and may specialise.
#ifdef __clang__
#define CALL __attribute__((noinline, unused)) static
#else
#define CALL __attribute__((noipa, unused)) static
#endif

// may_alias: vec_at() reads arrays of doubles by it, which C allows of no other struct.
struct __attribute__((may_alias)) vec3 {
    double x, y, z;
};

CALL struct vec3 new_vector(double x, double y, double z) {
    struct vec3 v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}

// An array as a vector, without a copy: common/ keeps vectors as arrays, the paper's program keeps
// structs.
static inline const struct vec3 *vec_at(const double a[3]) {
    return (const struct vec3 *)a;
}

CALL struct vec3 vec_add(struct vec3 a, struct vec3 b) {
    COUNT(vec_add, call);
    return (struct vec3){a.x + b.x, a.y + b.y, a.z + b.z};
}

CALL struct vec3 vec_sub(struct vec3 a, struct vec3 b) {
    COUNT(vec_sub, call);
    return (struct vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}

CALL struct vec3 vec_mult(struct vec3 a, struct vec3 b) {
    COUNT(vec_mult, call);
    return (struct vec3){a.x * b.x, a.y * b.y, a.z * b.z};
}

CALL struct vec3 vec_scale(struct vec3 a, double s) {
    COUNT(vec_scale, call);
    return (struct vec3){a.x * s, a.y * s, a.z * s};
}

CALL struct vec3 vec_abs(struct vec3 a) {
    COUNT(vec_abs, call);
    return (struct vec3){fabs(a.x), fabs(a.y), fabs(a.z)};
}

CALL double vec_dot(struct vec3 a, struct vec3 b) {
    COUNT(vec_dot, call);
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

CALL double vec_norm(struct vec3 a) {
    COUNT(vec_norm, call);
    return sqrt(a.x * a.x + a.y * a.y + a.z * a.z);
}

CALL struct vec3 vec_normalize(struct vec3 a) {
    COUNT(vec_normalize, call);
    return vec_scale(a, 1.0 / vec_norm(a));
}

// d reflected at the plane with unit normal n.
CALL struct vec3 vec_reflect(struct vec3 d, struct vec3 n) {
    COUNT(vec_reflect, call);
    return vec_sub(d, vec_scale(n, 2.0 * vec_dot(d, n)));
}
