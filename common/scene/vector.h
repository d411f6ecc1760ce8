// Vectors of three doubles.
#pragma once

#include <math.h>
#include <stdbool.h>
#include <string.h>

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

// Sets the matrix of a rotation about x, then y, then z. Each turns (u, v) to (c·u − s·v, s·u + c·v), on (y,z),
// (x,z) and (x,y).
static inline void rotation_matrix(const double *degrees, double m[3][3]) {
    static const int pair[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    memcpy(m, (double[3][3]){{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 9 * sizeof(double));
    for (int axis = 0; axis < 3; axis++) {
        double radians = degrees[axis] * (M_PI / 180.0), c = cos(radians), s = sin(radians);
        for (int k = 0; k < 3; k++) {
            double *u = &m[pair[axis][0]][k], *v = &m[pair[axis][1]][k], old = *u;
            *u = c * old - s * *v;
            *v = s * old + c * *v;
        }
    }
}
