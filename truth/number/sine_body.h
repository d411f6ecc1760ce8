// Sine and cosine over REAL intervals. Included by sine.h, once in doubles and once in quads.

// Returns Σ (−1)ᵏ x²ᵏ⁺ᵒ/(2k + o)! with o = first: the cosine for 0, the sine for 1. |x| is at most 0.8, where the first
// omitted term bounds the rest.
static inline struct IV FN(series)(struct IV x, int first) {
    struct IV term = first ? x : FN(point)(1), sum = term, square = FN(square)(x);
    for (int k = first + 2;; k += 2) {
        term = FN(neg)(FN(div)(FN(mul)(term, square), FN(point)((double)k * (k - 1))));
        if (k >= FN(LAST_TERM)) {
            REAL rest = FN(magnitude)(term);
            return FN(add)(sum, (struct IV){-rest, rest});
        }
        sum = FN(add)(sum, term);
    }
}

// Encloses sin(x + quarters·π/2) for |x| < 2³⁰.
static inline struct IV FN(sine_at)(REAL x, int quarters) {
    struct IV quarter = FN(scale)(FN(pi)(), 0.5), at = {x, x};
    long n = lrint((double)(x / quarter.lo));
    struct IV rest = FN(sub)(at, FN(mul)(FN(point)((double)n), quarter));
    int turned = (int)((n + quarters) & 3);
    struct IV value = FN(series)(rest, !(turned & 1));
    return turned & 2 ? FN(neg)(value) : value;
}

// Encloses sin(x + quarters·π/2) for all x of the interval.
static inline struct IV FN(sine)(struct IV x, int quarters) {
    if (!(x.hi - x.lo < 6) || !(FN(magnitude)(x) < (REAL)0x1p30))
        return (struct IV){-1, 1};
    struct IV value = FN(sine_at)(x.lo, quarters);
    if (x.hi > x.lo) {
        struct IV place = FN(div)(x, FN(scale)(FN(pi)(), 0.5)); // in quarter turns
        value = FN(hull)(value, FN(sine_at)(x.hi, quarters));
        for (long n = (long)ceil((double)place.lo - 1e-9); (REAL)n <= place.hi; n++) {
            int turned = (int)((n + quarters) & 3);
            value.hi = turned == 1 ? 1 : value.hi;
            value.lo = turned == 3 ? -1 : value.lo;
        }
    }
    return (struct IV){value.lo < -1 ? -1 : value.lo, value.hi > 1 ? 1 : value.hi};
}
