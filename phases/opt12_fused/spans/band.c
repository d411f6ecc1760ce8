// The regions of a frame in a band of rows, and the spans that they cut a row into.
#include <math.h>

#include "spans/spans.h"
#include "types/known_scene.h"

// Beyond all columns: at distance 1, in the picture's plane.
#define BEYOND 1e9

// Narrows [lo, hi] to where the item's sides hold.
static inline void cut_by_sides(const struct span_item *item, const double *y, double *lo,
                                double *hi) {
    for (int k = 0; k < item->lefts; k++) {
        double u = item->left[k].u, v = item->left[k].v;
        for (int r = 0; r < SPAN_BAND; r++) {
            double x = u + v * y[r];
            lo[r] = lo[r] > x ? lo[r] : x;
        }
    }
    for (int k = 0; k < item->rights; k++) {
        double u = item->right[k].u, v = item->right[k].v;
        for (int r = 0; r < SPAN_BAND; r++) {
            double x = u + v * y[r];
            hi[r] = hi[r] < x ? hi[r] : x;
        }
    }
}

// Narrows [lo, hi] to the conic's side. With xx < 0 a row meets it in an interval; else in two rays, of which one is
// on the side, and a row without roots is all within. Loops without branches: compilers vectorize them, but for the
// roots.
static inline void cut_by_conic(const struct span_conic *q, bool sure, const double *y, double *lo,
                                double *hi) {
    double b[SPAN_BAND], rest[SPAN_BAND], root[SPAN_BAND], one[SPAN_BAND], two[SPAN_BAND];
    for (int r = 0; r < SPAN_BAND; r++) {
        b[r] = q->xy * y[r] + q->x;
        rest[r] = b[r] * b[r] - q->xx * ((q->yy * y[r] + 2 * q->y) * y[r] + q->one);
    }
    for (int r = 0; r < SPAN_BAND; r++)
        root[r] = rest[r] > 0 ? sqrt(rest[r]) : 0;
    for (int r = 0; r < SPAN_BAND; r++) {
        double c = (q->yy * y[r] + 2 * q->y) * y[r] + q->one, sum = b[r] + copysign(root[r], b[r]);
        one[r] = -sum / q->xx;
        two[r] = -c / (sum + 1e-300);
    }
    if (q->xx < 0) {
        for (int r = 0; r < SPAN_BAND; r++) {
            double first = one[r] < two[r] ? one[r] : two[r],
                   last = one[r] < two[r] ? two[r] : one[r];
            double on = q->side[0] * 0.5 * (first + last) + q->side[1] * y[r] + q->side[2];
            first = on > 0 ? first : BEYOND;
            first = rest[r] > 0 ? first : BEYOND;
            lo[r] = lo[r] > first ? lo[r] : first;
            hi[r] = hi[r] < last ? hi[r] : last;
        }
        return;
    }
    double none = sure ? BEYOND : -BEYOND, sign = q->side[0] > 0 ? 1 : -1;
    for (int r = 0; r < SPAN_BAND;
         r++) { // the ray's end, of the mirrored row if it goes to the left
        double x = sign * one[r], other = sign * two[r];
        x = x > other ? x : other;
        x = rest[r] > 0 ? x : none;
        one[r] = sign * x;
    }
    for (int r = 0; r < SPAN_BAND && sign > 0; r++)
        lo[r] = lo[r] > one[r] ? lo[r] : one[r];
    for (int r = 0; r < SPAN_BAND && sign < 0; r++)
        hi[r] = hi[r] < one[r] ? hi[r] : one[r];
}

KERNEL_SHARED void fused_band_set(const struct fused_frame *frame, int top, int rows,
                                  struct fused_band *band) {
    double y[SPAN_BAND], lo[SPAN_BAND], hi[SPAN_BAND];
    for (int r = 0; r < SPAN_BAND; r++)
        y[r] = (frame->height - 1 - 2 * (top + r)) * frame->per_pixel;
    band->top = top;
    band->rows = rows;
    band->count = 0;
    double scale = 0.5 / frame->per_pixel, middle = 0.5 * (frame->width - 1);
    double most = frame->width + 4.0;
    for (int i = 0; i < frame->items; i++) {
        const struct span_item *item = &frame->item[i];
        struct band_span *to = &band->span[band->count];
        if (item->top > top + rows || item->bottom < top)
            continue;
        for (int r = 0; r < SPAN_BAND; r++) {
            lo[r] = -BEYOND;
            hi[r] = BEYOND;
        }
        cut_by_sides(item, y, lo, hi);
        if (item->curved)
            cut_by_conic(&item->conic, item->bit / 16 == ROLE_SURE / 16, y, lo, hi);
        int some = 0;
        for (int r = 0; r < SPAN_BAND; r++) {
            double a = lo[r] * scale + middle, b = hi[r] * scale + middle;
            bool in = r < rows && a <= b && b > -4 && a < most;
            some |= in;
            to->lo[r] = (float)(in ? (a > -4 ? a : -4) : most);
            to->hi[r] = (float)(in ? (b < most ? b : most) : -4);
        }
        to->bit = item->bit;
        band->count += some != 0;
    }
}

// The groups of pixels of one region in some rows, from first to last: those that it touches, or, where it is sure,
// those within it.
struct group_range {
    int first, last;
};

static inline struct group_range range_of(const struct band_span *span, int row, int rows,
                                          int grain, int groups) {
    bool sure = span->bit / 16 == ROLE_SURE / 16;
    float lo = span->lo[row], hi = span->hi[row];
    for (int r = 1; r < rows; r++) {
        float a = span->lo[row + r], b = span->hi[row + r];
        lo = (a < lo) == sure ? lo : a;
        hi = (b > hi) == sure ? hi : b;
    }
    if (!(lo <= hi))
        return (struct group_range){0, -1};
    const float slack = 0.01f; // pixels: lo and hi are rounded to float
    float per = 1.0f / (float)grain;
    int first, last;
    if (sure) {
        first = (int)ceilf((lo + slack) * per);
        last = (int)floorf((hi - slack + 1) * per) - 1;
    } else {
        first = (int)floorf((lo - slack) * per);
        last = (int)floorf((hi + slack) * per);
    }
    return (struct group_range){first < 0 ? 0 : first, last < groups ? last : groups - 1};
}

// What a group's mask says.
static inline struct fused_span span_of(const struct fused_frame *frame, uint64_t mask) {
    uint64_t all = 0xffff, may = mask & all, sure = mask >> ROLE_SURE & may;
    struct fused_span span = {.kind = SPAN_MIXED, .shape = -1, .hits = may};
    uint64_t solids = may & frame->solids;
    if (may & frame->planes) {
        span.darkeners = mask >> ROLE_DARK & all;
        span.reflected = mask >> ROLE_REFLECTED & all;
    }
    uint64_t plane = solids ? 0 : sure & frame->planes;
    uint64_t solid = sure & solids & frame->above;
    if (!may) {
        span.kind = SPAN_BACKGROUND;
    } else if (plane) {
        span.kind = SPAN_PLANE;
        span.shape = __builtin_ctzll(plane);
        span.hits = plane;
    } else if (solid && solid == solids && !(solids & (solids - 1))) {
        span.kind = SPAN_SOLID;
        span.shape = __builtin_ctzll(solid);
        span.hits = solid;
        span.darkeners = span.reflected = 0;
    }
    return span;
}

// Where the masks of groups change: a set of groups, and which bits change there.
struct span_cuts {
    uint64_t at[SPAN_GROUPS / 64 + 1], change[SPAN_GROUPS + 1];
};

static inline void cut_at(struct span_cuts *cuts, int group, uint64_t bit) {
    uint64_t *word = &cuts->at[group / 64], here = (uint64_t)1 << group % 64;
    if (!(*word & here))
        cuts->change[group] = 0;
    cuts->change[group] ^= bit;
    *word |= here;
}

static inline void set_cuts(const struct fused_band *band, int row, int rows, int grain, int groups,
                            struct span_cuts *cuts) {
    struct group_range range[64];
    uint64_t seen = 0;
    for (int i = 0; i < band->count; i++) {
        int bit = band->span[i].bit;
        struct group_range r = range_of(&band->span[i], row, rows, grain, groups);
        if (r.first > r.last)
            continue;
        if (seen >> bit & 1) { // by another plane
            r.first = r.first < range[bit].first ? r.first : range[bit].first;
            r.last = r.last > range[bit].last ? r.last : range[bit].last;
        }
        seen |= (uint64_t)1 << bit;
        range[bit] = r;
    }
    for (int w = 0; w <= groups / 64; w++)
        cuts->at[w] = 0;
    cut_at(cuts, groups, 0);
    for (; seen; seen &= seen - 1) {
        int bit = __builtin_ctzll(seen);
        cut_at(cuts, range[bit].first, (uint64_t)1 << bit);
        cut_at(cuts, range[bit].last + 1, (uint64_t)1 << bit);
    }
}

KERNEL_SHARED int fused_spans_of_rows(const struct fused_frame *frame,
                                      const struct fused_band *band, int y0, int rows,
                                      struct fused_span spans[SPAN_MOST]) {
    struct span_cuts cuts;
    int grain = frame->grain, groups = (frame->width + grain - 1) / grain, count = 0, from = 0;
    set_cuts(band, y0 - band->top, rows, grain, groups, &cuts);
    uint64_t mask = 0;
    for (int w = 0; w <= groups / 64; w++)
        for (uint64_t rest = cuts.at[w]; rest; rest &= rest - 1) {
            int group = 64 * w + __builtin_ctzll(rest);
            if (group > from) {
                spans[count] = span_of(frame, mask);
                spans[count].x0 = from * grain;
                spans[count++].x1 = group < groups ? group * grain : frame->width;
                from = group;
            }
            mask ^= cuts.change[group];
        }
    return count;
}
