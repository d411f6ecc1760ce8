// Sine and cosine of an angle in degrees as quad intervals. The angle is reduced exactly, in degrees, to at most 45, then
// both come from their alternating series. libm would round π/180 first, and its rounding has no direction.
#include "number/sine.h"

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
