// Numbers and vectors of three, compared within a tolerance.
#pragma once

#include "tests/c/testing.h"

#include "scene/vector.h"

static inline bool near(double a, double b, double tolerance) {
    if (!(fabs(a - b) <= tolerance)) {
        print_error("%.17g is not %.17g within %g\n", a, b, tolerance);
        return false;
    }
    return true;
}
