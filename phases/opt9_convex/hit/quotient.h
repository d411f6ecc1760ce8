// How enter_torus() divides: exactly. opt10_scene has quotients of 17 bits in its place.
#pragma once

#include "simd/simd.h"

#define SHORTER 0.0f // the part by which steps stay short of the surface, because quotients err

static inline vfloat quotient(vfloat a, vfloat b) {
    return a / b;
}
