// Vectors of three doubles.
#pragma once

#include <math.h>
#include <stdbool.h>

static inline double dot3(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Divides `a` by its length. Returns false for a vector of zeros or one with a NaN.
static inline bool normalize3(double a[3]) {
    double length = sqrt(dot3(a, a));
    if (length < 1e-140) { // the squares underflow: scale up and measure again
        for (int i = 0; i < 3; i++)
            a[i] *= 0x1p600;
        length = sqrt(dot3(a, a));
    }
    if (!(length > 0))
        return false;
    for (int i = 0; i < 3; i++)
        a[i] /= length;
    return true;
}

static inline void cross3(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}
