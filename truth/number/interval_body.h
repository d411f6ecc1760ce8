// Interval arithmetic over REAL. Included by interval.h, once in doubles and once in quads. U·(1 + 2U) is the relative
// size of a step outward.
struct IV {
    REAL lo, hi;
};

// At least the next number up, and down.
static inline REAL FN(above)(REAL x) {
    return x + (U * (1 + 2 * U) * (x < 0 ? -x : x) + (REAL)0x1p-1074);
}

static inline REAL FN(below)(REAL x) {
    return x - (U * (1 + 2 * U) * (x < 0 ? -x : x) + (REAL)0x1p-1074);
}

static inline struct IV FN(point)(double x) {
    return (struct IV){x, x};
}

static inline bool FN(is_point)(struct IV a, double x) {
    return a.lo == (REAL)x && a.hi == (REAL)x;
}

static inline REAL FN(mid)(struct IV a) {
    return a.lo + (a.hi - a.lo) * (REAL)0.5;
}

static inline bool FN(has_zero)(struct IV a) {
    return !(a.lo > 0 || a.hi < 0);
}

// Returns +1 or −1 where the sign is certain, else 0.
static inline int FN(sign)(struct IV a) {
    return a.lo > 0 ? 1 : a.hi < 0 ? -1 : 0;
}

static inline REAL FN(magnitude)(struct IV a) {
    REAL x = a.lo < 0 ? -a.lo : a.lo, y = a.hi < 0 ? -a.hi : a.hi;
    return x > y ? x : y;
}

static inline struct IV FN(hull)(struct IV a, struct IV b) {
    return (struct IV){a.lo < b.lo ? a.lo : b.lo, a.hi > b.hi ? a.hi : b.hi};
}

// The largest, and the least, of a number of a and one of b.
static inline struct IV FN(later)(struct IV a, struct IV b) {
    return (struct IV){a.lo > b.lo ? a.lo : b.lo, a.hi > b.hi ? a.hi : b.hi};
}

static inline struct IV FN(sooner)(struct IV a, struct IV b) {
    return (struct IV){a.lo < b.lo ? a.lo : b.lo, a.hi < b.hi ? a.hi : b.hi};
}

static inline struct IV FN(neg)(struct IV a) {
    return (struct IV){-a.hi, -a.lo};
}

// Returns the rounding error of sum = a + b, which is exact in rounding to nearest.
static inline REAL FN(sum_error)(REAL a, REAL b, REAL sum) {
    REAL b_part = sum - a;
    return (a - (sum - b_part)) + (b - b_part);
}

static inline struct IV FN(add)(struct IV a, struct IV b) {
    REAL lo = a.lo + b.lo, hi = a.hi + b.hi;
    REAL under = FN(sum_error)(a.lo, b.lo, lo), over = FN(sum_error)(a.hi, b.hi, hi);
    // An error that is NaN widens, too.
    return (struct IV){under >= 0 ? lo : FN(below)(lo), over <= 0 ? hi : FN(above)(hi)};
}

static inline struct IV FN(sub)(struct IV a, struct IV b) {
    return FN(add)(a, FN(neg)(b));
}

static inline REAL FN(product_below)(REAL a, REAL b) {
    REAL p = a * b;
    return FN(exact_product)(a, b) ? p : FN(below)(p);
}

static inline REAL FN(product_above)(REAL a, REAL b) {
    REAL p = a * b;
    return FN(exact_product)(a, b) ? p : FN(above)(p);
}

// Returns an interval that holds four rounded numbers before rounding.
static inline struct IV FN(hull_of_four)(REAL p, REAL q, REAL r, REAL s) {
    REAL least = p < q ? p : q, most = p > q ? p : q;
    least = least < r ? least : r;
    least = least < s ? least : s;
    most = most > r ? most : r;
    most = most > s ? most : s;
    return (struct IV){FN(below)(least), FN(above)(most)};
}

static inline struct IV FN(mul)(struct IV a, struct IV b) {
    if (a.lo == a.hi && b.lo == b.hi) {
        REAL p = a.lo * b.lo;
        if (FN(exact_product)(a.lo, b.lo))
            return (struct IV){p, p};
        return (struct IV){FN(below)(p), FN(above)(p)};
    }
    if (a.lo >= 0 && b.lo >= 0)
        return (struct IV){FN(product_below)(a.lo, b.lo), FN(product_above)(a.hi, b.hi)};
    if (a.hi <= 0 && b.hi <= 0)
        return (struct IV){FN(product_below)(a.hi, b.hi), FN(product_above)(a.lo, b.lo)};
    if (a.lo >= 0 && b.hi <= 0)
        return (struct IV){FN(product_below)(a.hi, b.lo), FN(product_above)(a.lo, b.hi)};
    if (a.hi <= 0 && b.lo >= 0)
        return (struct IV){FN(product_below)(a.lo, b.hi), FN(product_above)(a.hi, b.lo)};
    return FN(hull_of_four)(a.lo * b.lo, a.lo * b.hi, a.hi * b.lo, a.hi * b.hi);
}

static inline struct IV FN(scale)(struct IV a, double x) {
    return FN(mul)(a, FN(point)(x));
}

static inline struct IV FN(square)(struct IV a) {
    if (a.lo >= 0 || a.hi <= 0)
        return FN(mul)(a, a);
    REAL most = FN(magnitude)(a);
    return (struct IV){0, FN(product_above)(most, most)};
}

// Returns a/b; everything if b may be 0.
static inline struct IV FN(div)(struct IV a, struct IV b) {
    if (FN(has_zero)(b))
        return (struct IV){-(REAL)INFINITY, (REAL)INFINITY};
    if (a.lo == 0 && a.hi == 0)
        return a;
    if (FN(is_point)(b, 1))
        return a;
    return FN(hull_of_four)(a.lo / b.lo, a.lo / b.hi, a.hi / b.lo, a.hi / b.hi);
}

// Returns the roots of what is not negative in a. The bounds are checked by their squares.
static inline struct IV FN(sqrt)(struct IV a) {
    struct IV r = {0, 0};
    if (a.lo > 0) {
        r.lo = FN(below)(FN(sqrt_near)(a.lo));
        while (FN(product_above)(r.lo, r.lo) > a.lo)
            r.lo = FN(below)(r.lo);
    }
    if (a.hi > 0) {
        r.hi = FN(above)(FN(sqrt_near)(a.hi));
        while (FN(product_below)(r.hi, r.hi) < a.hi)
            r.hi = FN(above)(r.hi);
    }
    if (FN(is_point)(a, 1))
        return a;
    return r;
}

// Vectors of three intervals.
static inline struct IV FN(dot)(const struct IV a[3], const struct IV b[3]) {
    return FN(add)(FN(add)(FN(mul)(a[0], b[0]), FN(mul)(a[1], b[1])), FN(mul)(a[2], b[2]));
}

static inline struct IV FN(norm_sq)(const struct IV a[3]) {
    return FN(add)(FN(add)(FN(square)(a[0]), FN(square)(a[1])), FN(square)(a[2]));
}
