// Double-double arithmetic, about 104 bits, for what is not proved: T. J. Dekker, Numer. Math. 18 (1971); Y.
// Hida, X. S. Li, D. H. Bailey, "Algorithms for quad-double precision floating point arithmetic" (2001).
#pragma once

#include <math.h>
#include <stdbool.h>

#include "number/quad.h"

struct dd {
    double hi, lo;
};

static inline struct dd dd_from(double x) {
    return (struct dd){x, 0};
}

static inline struct dd dd_from_quad(quad x) {
    double hi = (double)x;
    return (struct dd){hi, (double)(x - (quad)hi)};
}

// a + b as sum and error, for |a| ≥ |b|.
static inline struct dd quick_sum(double a, double b) {
    double sum = a + b;
    return (struct dd){sum, b - (sum - a)};
}

// a + b as sum and error.
static inline struct dd exact_sum(double a, double b) {
    double sum = a + b, part = sum - a;
    return (struct dd){sum, (a - (sum - part)) + (b - part)};
}

// a·b as product and error.
static inline struct dd exact_product(double a, double b) {
    double p = a * b;
    double s = 134217729.0 * a, t = 134217729.0 * b; // 2²⁷ + 1 splits a double into halves
    double a1 = s - (s - a), b1 = t - (t - b);
    double a2 = a - a1, b2 = b - b1;
    return (struct dd){p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2};
}

static inline struct dd dd_neg(struct dd a) {
    return (struct dd){-a.hi, -a.lo};
}

static inline struct dd dd_add(struct dd a, struct dd b) {
    struct dd s = exact_sum(a.hi, b.hi), t = exact_sum(a.lo, b.lo);
    s = quick_sum(s.hi, s.lo + t.hi);
    return quick_sum(s.hi, s.lo + t.lo);
}

static inline struct dd dd_sub(struct dd a, struct dd b) {
    return dd_add(a, dd_neg(b));
}

static inline struct dd dd_mul(struct dd a, struct dd b) {
    struct dd p = exact_product(a.hi, b.hi);
    return quick_sum(p.hi, p.lo + (a.hi * b.lo + a.lo * b.hi));
}

static inline struct dd dd_scale(struct dd a, double x) {
    return dd_mul(a, dd_from(x));
}

// Times a power of two, which is exact.
static inline struct dd dd_twofold(struct dd a, double power) {
    return (struct dd){a.hi * power, a.lo * power};
}

static inline struct dd dd_div(struct dd a, struct dd b) {
    double q = a.hi / b.hi;
    struct dd rest = dd_sub(a, dd_scale(b, q));
    double r = rest.hi / b.hi;
    rest = dd_sub(rest, dd_scale(b, r));
    return dd_add(quick_sum(q, r), dd_from(rest.hi / b.hi));
}

static inline struct dd dd_sqr(struct dd a) {
    return dd_mul(a, a);
}

static inline struct dd dd_sqrt(struct dd a) {
    if (!(a.hi > 0))
        return dd_from(0);
    double root = sqrt(a.hi), half = 0.5 / root;
    struct dd rest = dd_sub(a, exact_product(root, root));
    struct dd r = quick_sum(root, rest.hi * half);
    rest = dd_sub(a, dd_sqr(r));
    return dd_add(r, dd_from(rest.hi * half));
}

static inline bool dd_less(struct dd a, struct dd b) {
    return a.hi < b.hi || (a.hi == b.hi && a.lo < b.lo);
}

static inline struct dd dd_abs(struct dd a) {
    return a.hi < 0 || (a.hi == 0 && a.lo < 0) ? dd_neg(a) : a;
}

static inline struct dd dd_min(struct dd a, struct dd b) {
    return dd_less(b, a) ? b : a;
}

static inline struct dd dd_max(struct dd a, struct dd b) {
    return dd_less(a, b) ? b : a;
}

static inline struct dd dd_floor(struct dd a) {
    double hi = floor(a.hi);
    return hi == a.hi ? quick_sum(hi, floor(a.lo)) : dd_from(hi);
}

// Returns ln a = power·ln 2 + 2 artanh((m − 1)/(m + 1)) with m from √½ to √2: the series of 23 terms reaches 2⁻¹⁰⁸.
static inline struct dd dd_log(struct dd a) {
    int power;
    double m = frexp(a.hi, &power);
    if (m < 0.70710678118654752)
        power--;
    double scale = ldexp(1.0, -(power / 2)), rest = ldexp(1.0, -(power - power / 2));
    a = dd_twofold(dd_twofold(a, scale), rest);
    struct dd one = dd_from(1), z = dd_div(dd_sub(a, one), dd_add(a, one));
    struct dd square = dd_sqr(z), sum = dd_div(one, dd_from(45));
    for (int k = 43; k > 0; k -= 2)
        sum = dd_add(dd_mul(sum, square), dd_div(one, dd_from(k)));
    struct dd ln2 = {0x1.62e42fefa39efp-1, 0x1.abc9e3b39803fp-56};
    return dd_add(dd_scale(ln2, power), dd_twofold(dd_mul(sum, z), 2));
}

static const struct dd DD_PI = {0x1.921fb54442d18p+1, 0x1.1a62633145c07p-53};

// Returns sin(a + quarters·π/2) for |a| < 2³⁰: Taylor's series of an angle of at most π/4.
static inline struct dd dd_sine(struct dd a, int quarters) {
    long n = lrint(a.hi / (DD_PI.hi / 2));
    struct dd x = dd_sub(a, dd_scale(dd_twofold(DD_PI, 0.5), (double)n));
    int turned = (int)((n + quarters) & 3), first = !(turned & 1);
    struct dd square = dd_neg(dd_mul(x, x)), sum = dd_from(1);
    for (int k = 28 + first; k >= 2 + first; k -= 2)
        sum = dd_add(dd_from(1), dd_div(dd_mul(sum, square), dd_from((double)k * (k - 1))));
    sum = first ? dd_mul(sum, x) : sum;
    return turned & 2 ? dd_neg(sum) : sum;
}

static inline struct dd dd_dot(const struct dd a[3], const struct dd b[3]) {
    return dd_add(dd_add(dd_mul(a[0], b[0]), dd_mul(a[1], b[1])), dd_mul(a[2], b[2]));
}

static inline struct dd dd_norm(const struct dd a[3]) {
    return dd_sqrt(dd_dot(a, a));
}

// out = a + s·b
static inline void dd_along(const struct dd a[3], struct dd s, const struct dd b[3],
                            struct dd out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = dd_add(a[i], dd_mul(s, b[i]));
}
