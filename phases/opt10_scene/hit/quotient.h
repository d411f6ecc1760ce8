// How enter_torus() divides: by approximate inverses. The divider takes 15 cycles for sixteen quotients.
#pragma once

#include "simd/simd.h"

#define SHORTER                                                                                    \
    2e-4f // a quotient errs by less than 1e-5; steps stay short of the surface by this part of them

// Returns 1/a for normal a to 1e-5, with the sign of a, the same for any number of lanes: a linear guess from
// the bits and two of Newton's steps.
static inline vfloat near_inverse(vfloat a) {
    typedef unsigned whole __attribute__((vector_size(sizeof(vfloat))));
    vfloat r = (vfloat)(0x7ef311c3u - (whole)a);
    r = r * v_nmadd(a, r, v_splat(2.0f));
    return r * v_nmadd(a, r, v_splat(2.0f));
}

static inline vfloat quotient(vfloat a, vfloat b) {
    return a * near_inverse(b);
}
