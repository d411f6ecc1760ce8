// The spans of a ray where a function of s is below 0: its roots, isolated by signs over intervals (R. E. Moore, "Interval
// Analysis", 1966, chapter 6), then by interval Newton. Included by ray_spans.c, once in doubles and once in quads.

// A function of s: enclosed on an interval; its sign at s; −1 inside, 1 outside, 0 if it is not certain.
struct FN(curve) {
    void *of;
    struct FN(jet) (*over)(void *of, REAL lo, REAL m, REAL hi);
    int (*sign)(void *of, REAL s), (*side)(void *of, REAL s);
};

struct FN(root) {
    struct IV s;
    bool fuzzy; // not proved to be one single root
};

// Refines x, where the function is monotone and changes its sign: x holds one root.
static struct IV FN(refine_root)(const struct FN(curve) * curve, struct IV x, int sign_low) {
    for (int i = 0; i < 200; i++) {
        REAL m = FN(mid)(x), width = x.hi - x.lo;
        if (!(m > x.lo && m < x.hi))
            break;
        struct FN(jet) jet = curve->over(curve->of, x.lo, m, x.hi);
        struct IV next = FN(sub)((struct IV){m, m}, FN(div)(jet.at, jet.slope));
        if (next.lo < x.lo || !(next.lo <= x.hi))
            next.lo = x.lo;
        if (next.hi > x.hi || !(next.hi >= x.lo))
            next.hi = x.hi;
        if (next.hi - next.lo > width * (REAL)0.5) { // halve it
            int sign = FN(sign)(jet.at);
            if (sign == 0)
                return next;
            if (sign == sign_low)
                next.lo = next.lo > m ? next.lo : m;
            else
                next.hi = next.hi < m ? next.hi : m;
        }
        if (!(next.hi - next.lo < width))
            break;
        x = next;
    }
    return x;
}

static bool FN(add_root)(struct FN(root) events[MAX_ROOTS], int *count, struct IV s, bool fuzzy) {
    struct FN(root) *last = events + *count - 1;
    if (*count > 0 && last->s.hi >= s.lo) { // the intervals touch: one, without proof
        last->s = FN(hull)(last->s, s);
        last->fuzzy = true;
        return true;
    }
    if (*count == MAX_ROOTS)
        return false;
    events[(*count)++] = (struct FN(root)){s, fuzzy};
    return true;
}

// Finds all intervals where the function may be 0, in order. Returns false if they are too many. `entry`: ends after the
// first root from outside to inside that is not at the range's start, and ends the range there.
static bool FN(isolate_roots)(const struct FN(curve) * curve, struct IV *range, bool entry,
                              struct FN(root) events[MAX_ROOTS], int *count) {
    struct IV stack[160];
    int depth = 0;
    REAL scale = range->hi - range->lo, start = range->lo;
    stack[depth++] = *range;
    for (int rounds = 0; depth > 0; rounds++) {
        if (rounds > MAX_ROUNDS)
            return false;
        struct IV x = stack[--depth];
        REAL m = x.lo + (x.hi - x.lo) * (REAL)0.484375;
        struct FN(jet) jet = curve->over(curve->of, x.lo, m, x.hi);
        if (!FN(has_zero)(jet.over))
            continue;
        if (!FN(has_zero)(jet.slope)) {
            int p = curve->sign(curve->of, x.lo), r = curve->sign(curve->of, x.hi);
            if (p * r > 0)
                continue;
            if (p * r < 0) {
                if (!FN(add_root)(events, count, FN(refine_root)(curve, x, p), false))
                    return false;
                if (entry && p > 0 && events[*count - 1].s.lo > start) {
                    range->hi = x.hi;
                    return true;
                }
                continue;
            }
        }
        // Near a double root the value is rounding alone: smaller intervals would tell no more.
        bool drowned = jet.over.hi - jet.over.lo <= (jet.at.hi - jet.at.lo) * 4;
        if (drowned || x.hi - x.lo <= (REAL)FN(RESOLUTION) * scale || depth + 2 > 160 ||
            !(m > x.lo && m < x.hi)) {
            if (!FN(add_root)(events, count, x, true))
                return false;
            continue;
        }
        stack[depth++] = (struct IV){m, x.hi};
        stack[depth++] = (struct IV){x.lo, m};
    }
    return true;
}

// Finds the spans from the roots and from the side that the ray is on between them.
static void FN(spans_between_roots)(const struct FN(curve) * curve, const struct FN(root) * events,
                                    int count, struct IV range, int side, bool open,
                                    struct FN(spans) * spans) {
    struct FN(span) span = FN(whole_ray); // a ray that starts inside is inside before
    REAL end = range.hi;
    span.in_face = span.out_face = 0;
    if (side == 0) {
        span.in = span.out = range;
        span.sure = false;
        FN(add_span)(spans, span);
        return;
    }
    for (int i = 0; i < count; i++) {
        struct IV s = events[i].s;
        struct IV gap = {s.hi, i + 1 < count ? events[i + 1].s.lo : end};
        int next = i + 1 == count && !open ? 1 : curve->side(curve->of, FN(mid)(gap));
        if (next == 0) { // nothing is known from here on
            span.in = side < 0 ? span.in : s;
            span.out = (struct IV){s.lo, end};
            span.sure = false;
            FN(add_span)(spans, span);
            return;
        }
        if (side > 0 && next < 0) {
            span.in = s;
            span.out = (struct IV){(REAL)INFINITY, (REAL)INFINITY};
            span.sure = true;
        } else if (side < 0 && next > 0) {
            span.out = s;
            FN(add_span)(spans, span);
        } else if (side > 0 && events[i].fuzzy) { // may touch
            span.in = span.out = s;
            span.sure = false;
            FN(add_span)(spans, span);
        } else if (side < 0 && events[i].fuzzy) { // may leave for a moment
            span.out = s;
            span.sure = true;
            FN(add_span)(spans, span);
            span.in = s;
            span.out = (struct IV){(REAL)INFINITY, (REAL)INFINITY};
            span.sure = false;
        }
        side = next;
    }
    if (side < 0)
        FN(add_span)(spans, span); // the ray ends inside
}

// Adds the spans in the range. side: on which the ray is at its start. open: the ray may be inside at its end. entry: no
// span behind the first one that begins in the range is needed.
static void FN(spans_of_curve)(const struct FN(curve) * curve, struct IV range, int side, bool open,
                               bool entry, struct FN(spans) * spans) {
    struct FN(root) events[MAX_ROOTS];
    int count = 0;
    REAL end = range.hi;
    if (!FN(isolate_roots)(curve, &range, entry, events, &count))
        spans->overflow = true;
    else
        FN(spans_between_roots)(curve, events, count, range, side, open || range.hi < end, spans);
}
