// Sine and cosine of an angle in degrees as quad intervals. The angle is reduced exactly, in degrees, to at most 45, then
// both come from their alternating series. libm would round π/180 first, and its rounding has no direction.
#include "number/angles.h"

// π as the sum of three doubles and what they leave (below 2⁻¹⁶¹).
static struct ivq pi_q(void) {
    struct ivq pi = add_q(point_q(0x1.921fb54442d18p+1), point_q(0x1.1a62633145c07p-53));
    return add_q(pi, (struct ivq){-(quad)0x1.f1976b7ed8fbdp-109, -(quad)0x1.f1976b7ed8fbbp-109});
}

// Returns Σ (−1)ᵏ x²ᵏ⁺ᵒ/(2k + o)! with o = first: the cosine for 0, the sine for 1. x is from 0 to 0.8, where the first
// omitted term bounds the rest.
static struct ivq series_q(struct ivq x, int first) {
    struct ivq term = first ? x : point_q(1), sum = term, square = square_q(x);
    for (int k = first + 2; k < 44; k += 2) {
        term = neg_q(div_q(mul_q(term, square), point_q((double)k * (k - 1))));
        if (k >= 42) {
            quad rest = magnitude_q(term);
            return add_q(sum, (struct ivq){-rest, rest});
        }
        sum = add_q(sum, term);
    }
    return sum;
}

void sine_cosine_q(double degrees, struct ivq *sine, struct ivq *cosine) {
    double angle = fmod(degrees, 360.0); // exact
    bool negative = angle < 0;
    angle = fabs(angle);
    int quarter = (int)(angle / 90.0); // exact below 360: 90, 180, 270 divide without rounding up
    angle -= 90.0 * quarter;
    bool swap = angle > 45.0;
    // 90 − angle in quad is exact.
    quad reduced = swap ? (quad)90 - (quad)angle : (quad)angle;
    struct ivq s = point_q(0), c = point_q(1);
    if (reduced != 0) {
        struct ivq x = div_q(mul_q((struct ivq){reduced, reduced}, pi_q()), point_q(180));
        s = series_q(x, 1);
        c = series_q(x, 0);
    }
    if (swap) {
        struct ivq t = s;
        s = c;
        c = t;
    }
    for (int i = 0; i < (quarter & 3); i++) { // a quarter turn: (s, c) → (c, −s)
        struct ivq t = s;
        s = c;
        c = neg_q(t);
    }
    *sine = negative ? neg_q(s) : s;
    *cosine = c;
}
