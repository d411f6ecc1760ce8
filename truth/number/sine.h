// Sine and cosine of radians as intervals of doubles and of quads. libm's rounding has no direction, so both come from
// their alternating series.
#pragma once

#include "number/interval.h"

// angles.c: encloses sine and cosine of the exact angle. Quarter turns give points.
void sine_cosine_q(double degrees, struct ivq *sine, struct ivq *cosine);

static inline struct ivd pi_d(void) {
    return (struct ivd){0x1.921fb54442d18p+1, 0x1.921fb54442d19p+1};
}

// π as the sum of three doubles and what they leave (below 2⁻¹⁶¹).
static inline struct ivq pi_q(void) {
    struct ivq pi = add_q(point_q(0x1.921fb54442d18p+1), point_q(0x1.1a62633145c07p-53));
    return add_q(pi, (struct ivq){-(quad)0x1.f1976b7ed8fbdp-109, -(quad)0x1.f1976b7ed8fbbp-109});
}

enum { LAST_TERM_d = 22, LAST_TERM_q = 42 }; // of the series
#define BODY "number/sine_body.h"
#include "number/twice.h"
