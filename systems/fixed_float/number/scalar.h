// One number of the phase outside of the lanes: a float. Lengths are in scene units.
#pragma once

#include "number/format.h"

typedef float scalar;

static inline scalar scalar_from(double a, const struct format *f) {
    (void)f;
    return (float)a;
}

static inline scalar scalar_from_length(double length, const struct format *f) {
    return scalar_from(length, f);
}

static inline scalar scalar_from_per_length(double a, const struct format *f) {
    return scalar_from(a, f);
}

static inline double in_units(double length, const struct format *f) {
    (void)f;
    return length;
}

// Returns how far a normalised direction may be from the exact one. It has room for the discriminant's rounding, which
// is a difference of floats.
static inline double direction_error(const struct format *f) {
    (void)f;
    return 0x1p-20;
}
