// Sine and cosine of radians as intervals of doubles and of quads. libm's rounding has no direction, so both come from
// their alternating series.
#pragma once

#include "number/interval.h"

static inline struct ivd pi_d(void) {
    return (struct ivd){0x1.921fb54442d18p+1, 0x1.921fb54442d19p+1};
}

// π as the sum of three doubles and what they leave (below 2⁻¹⁶¹).
static inline struct ivq pi_q(void) {
    struct ivq pi = add_q(point_q(0x1.921fb54442d18p+1), point_q(0x1.1a62633145c07p-53));
    return add_q(pi, (struct ivq){-(quad)0x1.f1976b7ed8fbdp-109, -(quad)0x1.f1976b7ed8fbbp-109});
}

#define REAL double
#define IV ivd
#define FN(name) name##_d
#define LAST_TERM 22
#include "number/sine_body.h"
#undef REAL
#undef IV
#undef FN
#undef LAST_TERM

#define REAL quad
#define IV ivq
#define FN(name) name##_q
#define LAST_TERM 42
#include "number/sine_body.h"
#undef REAL
#undef IV
#undef FN
#undef LAST_TERM
