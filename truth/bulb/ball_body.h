// Balls under the Mandelbulb's map, over REAL. Included by bulb_hit.c, once in doubles and once in quads.
//
// A ball is a centre, computed with rounding, and a radius that covers all errors: U is the unit roundoff, and every
// radius is enlarged by more than what its few operations can lose.

// The local ray o + s·d in numbers, with bounds of how far they are from the exact ones and of their lengths.
struct FN(line) {
    REAL o[3], d[3], o_error, d_error, o_length, d_length;
};

static inline REAL FN(root)(REAL x) {
    return x > 0 ? FN(sqrt_near)(x) : 0;
}

// |z| within 8u·|z|.
static inline REAL FN(length)(const REAL z[3]) {
    return FN(root)(z[0] * z[0] + z[1] * z[1] + z[2] * z[2]);
}

static inline REAL FN(size)(REAL x) {
    return x < 0 ? -x : x;
}

static inline void FN(complex_square)(REAL q[2]) {
    REAL real = q[0] * q[0] - q[1] * q[1];
    q[1] = 2 * (q[0] * q[1]);
    q[0] = real;
}

// z ← z⁸ + c. With (y + iρ)⁸ = a and ((x + iz)/ρ)⁸ = b that is (−a₁b₁, a₀, a₁b₀) + c. A square of complex numbers is
// off by √5·u (R. Brent, C. Percival, P. Zimmermann, Math. Comp. 76 (2007)), ρ by 5u, so all by 256u·(|z|⁸ + |c|).
static void FN(bulb_power)(REAL z[3], const REAL c[3]) {
    REAL rho = FN(root)(z[0] * z[0] + z[2] * z[2]);
    REAL a[2] = {z[1], rho}, b[2] = {1, 0};
    if (rho > 0) {
        b[0] = z[0] / rho;
        b[1] = z[2] / rho;
    }
    for (int i = 0; i < 3; i++) {
        FN(complex_square)(a);
        FN(complex_square)(b);
    }
    z[0] = c[0] - a[1] * b[1];
    z[1] = c[1] + a[0];
    z[2] = c[2] + a[1] * b[0];
}

// Returns the largest norm of the power's Jacobian over the ball (z, e); r is |z|. The power multiplies the lengths
// along r and θ by 8r⁷, along φ by 8r⁷·f with f(θ) = sin 8θ/sin θ = 2(cos θ + cos 3θ + cos 5θ + cos 7θ), so |f| ≤ 8 and
// |f′| ≤ 32. Seen from the origin the ball's radius is asin(e/r) ≤ 1.0473·e/r for e ≤ r/2.
static REAL FN(stretch)(const REAL z[3], REAL r, REAL e) {
    REAL most = r + e, square = most * most, ratio = 8;
    if (2 * e < r) {
        REAL u = z[1] / r, a = 2 * u * u - 1, b = 2 * a * a - 1;
        ratio = FN(size)(8 * u * a * b) + (REAL)33.6 * (e / r) + 4096 * U;
        ratio = ratio < 1 ? 1 : ratio > 8 ? 8 : ratio;
    }
    return 8 * (square * square * square) * most * ratio;
}

// Returns on which side of the surface |zₙ| = 1 every point of the ball (c, e) is: +1 outside, −1 inside, 0 undecided.
// A point with |zₖ| ≥ max(1.125, |c|) escapes: |zₖ₊₁| ≥ |zₖ|⁸ − |c| > |zₖ|. A bailout is at least 4: |z| = 2 is such.
static int FN(ball_side)(int iterations, const REAL c[3], REAL e) {
    REAL z[3] = {c[0], c[1], c[2]}, start = e, far = FN(length)(c) * (1 + 8 * U) + e;
    for (int i = 0;; i++) {
        REAL r = FN(length)(z), least = r - e - 16 * U * (r + e), most = r + e + 16 * U * (r + e);
        if (least >= (REAL)1.125 && (i == 0 || least >= far))
            return 1;
        if (i == iterations)
            return least > 1 ? 1 : most < 1 ? -1 : 0;
        if (!(e < 1))
            return 0;
        REAL square = most * most, power = square * square * square * square;
        e = FN(stretch)(z, r, e) * e + start + 256 * U * (power + far) + (REAL)0x1p-450;
        e *= 1 + 64 * U;
        FN(bulb_power)(z, c);
    }
}

// The same of the shape and its copies: a ball that reaches over a wall of its cell is in two copies.
static int FN(shape_side)(const struct shape *shape, const REAL p[3], REAL e, int axis) {
    for (; axis < 3 && !(shape->repeat[axis] > 0); axis++)
        continue;
    if (axis == 3)
        return FN(ball_side)(shape->mandelbulb.iterations, p, e);
    REAL cell = shape->repeat[axis], moved[3] = {p[0], p[1], p[2]};
    double index = floor((double)(p[axis] / cell) + 0.5);
    moved[axis] = p[axis] - (REAL)index * cell;
    e += 8 * U * FN(size)(p[axis]);
    if (!(2 * e < cell))
        return 0;
    int side = FN(shape_side)(shape, moved, e, axis + 1);
    if (side == 0 || FN(size)(moved[axis]) + e < cell * (REAL)0.499)
        return side;
    moved[axis] += moved[axis] < 0 ? cell : -cell;
    return FN(shape_side)(shape, moved, e, axis + 1) == side ? side : 0;
}

static struct FN(line) FN(line_of)(const struct ray_q *local) {
    struct FN(line) line;
    REAL *to[2] = {line.o, line.d}, error[2] = {0, 0};
    for (int i = 0; i < 3; i++) {
        const struct ivq of[2] = {local->o[i], local->d[i]};
        for (int j = 0; j < 2; j++) {
            to[j][i] = (REAL)mid_q(of[j]);
            error[j] += (REAL)(of[j].hi - of[j].lo) * (1 + 8 * U) + 4 * U * FN(size)(to[j][i]);
        }
    }
    line.o_error = error[0];
    line.d_error = error[1];
    line.o_length = FN(length)(line.o) * (1 + 16 * U) + error[0];
    line.d_length = FN(length)(line.d) * (1 + 16 * U) + error[1];
    return line;
}

// A bound of |p| at s: all rounding is in proportion to it.
static inline REAL FN(reach_of)(const struct FN(line) * line, REAL s) {
    return line->o_length + s * line->d_length;
}

// Returns the side of the segment a ≤ s ≤ b.
static int FN(segment_side)(const struct shape *shape, const struct FN(line) * line, REAL a,
                            REAL b) {
    REAL s = (REAL)0.5 * (a + b), half = b - s > s - a ? b - s : s - a, p[3];
    for (int i = 0; i < 3; i++)
        p[i] = line->o[i] + s * line->d[i];
    REAL e = half * line->d_length + line->o_error + s * line->d_error;
    e = e * (1 + 16 * U) + 16 * U * FN(reach_of)(line, s);
    return FN(shape_side)(shape, p, e, 0);
}

// Walks from `walk->from` to `reach` while segments are proved to be on the side `from_side`. A segment that is not
// decided is halved; at the least length the walk looks ahead for a point that is on the other side for sure: then the
// first crossing lies between. `walk->sure` is false where it finds none.
static void FN(walk)(const struct shape *shape, const struct FN(line) * line, double reach,
                     int from_side, struct walk *walk) {
    REAL s = walk->from, step = reach - s;
    walk->crossed = false;
    walk->sure = true;
    while (s < reach) {
        if (walk->balls++ > MOST_BALLS) {
            walk->sure = false;
            break;
        }
        REAL size = FN(reach_of)(line, s), shortest = 256 * U * size / line->d_length;
        REAL end = s + step < reach ? s + step : reach;
        int side = FN(segment_side)(shape, line, s, end);
        if (side == from_side) {
            s = end;
            step *= 2;
            continue;
        }
        if (end - s > shortest) {
            step = (REAL)0.5 * (end - s);
            continue;
        }
        REAL ahead = end, most = s + WIDEST * size / line->d_length;
        while (side == 0 && ahead < most && ahead < reach) {
            ahead += (REAL)0.25 * (ahead - s);
            side = FN(segment_side)(shape, line, ahead, ahead + shortest);
            walk->balls++;
        }
        walk->from = double_below(s);
        walk->to = double_above(ahead);
        walk->crossed = side == -from_side && walk->to <= reach;
        walk->sure = walk->crossed;
        return;
    }
    walk->from = (double)s;
}
