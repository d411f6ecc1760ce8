// One number of the phase outside of the lanes: fixed point in 64 bits, and its conversions from double.
#pragma once

#include <math.h>
#include <stdint.h>

#include "number/format.h"

typedef int64_t scalar;

// Returns the number nearest to `a`, which has no unit.
static inline scalar scalar_from(double a, const struct format *f) {
    return llrint(a / f->scale);
}

// Returns the number nearest to a length in scene units.
static inline scalar scalar_from_length(double length, const struct format *f) {
    return llrint(length / f->length_scale);
}

// Returns the number nearest to `a`, which is per scene unit of length, like the light's emission.
static inline scalar scalar_from_per_length(double a, const struct format *f) {
    return scalar_from(ldexp(a, -f->unit), f);
}

// Returns a length in scene units as a length in units of the format, in doubles.
static inline double in_units(double length, const struct format *f) {
    return length / ldexp(1, f->unit);
}

// Returns how far a normalised direction may be from the exact one: rounding, and the error of 1/√.
// The article's 1/√ has two Newton steps.
static inline double direction_error(const struct format *f) {
    static const double by_newton_steps[] = {5e-6, 2e-3, 5e-6};
    return ldexp(8, -f->bits) + (f->newton_steps < 3 ? by_newton_steps[f->newton_steps] : 0);
}
