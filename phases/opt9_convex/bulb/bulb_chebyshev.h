// Marches of camera rays close to a Mandelbulb, where the last digits of a ray's steps decide where it ends
// (bulb/bulb_march.c). The first iteration comes from polynomials along a piece of the ray (bulb/chebyshev_pieces.h).
#ifndef OPT9_BULB_CHEBYSHEV_H
#define OPT9_BULB_CHEBYSHEV_H

#include "core/known_scene.h"
#include "simd/point.h"

struct worker_scratch;

// A ray is close from an estimate below CLOSE_ESTIMATE on. At the end of a piece it leaves if its estimate is above
// LEAVE_ESTIMATE. The step is no measure: over a plane it may be short far from the bulb, where the first iteration has
// escaped and chebyshev_orbit()'s estimate is too short.
#define CLOSE_ESTIMATE 5e-3f

// Steps are counted in floats, which cannot count past 2^24. At this count it restarts at 0, and N_BORN is shifted to match.
#define STEPS_COUNTED 0x1p23f

enum { CLOSE_TERMS = 6, SLOPE_TERMS = 4, CLOSE_VALUES = 4 }; // x, y, z and the derivative

// The fields of a lane. Distances along the ray count from the middle of its piece.
enum chebyshev_field {
    N_TERM, // coefficients of x, y and z: the constants, then the factors of t, of t² …
    N_SLOPE_TERM = 3 * CLOSE_TERMS,
    N_PLACE = N_SLOPE_TERM + SLOPE_TERMS,
    N_DIRECTION = N_PLACE + 3,
    N_T = N_DIRECTION + 3,
    N_END, // of the piece, or of the ray
    N_TO,  // of the ray
    N_HEIGHT,
    N_SLOPE,
    N_MIDDLE,
    N_RAY, // its index in scratch->bulb
    N_BORN,
    N_FIELDS
};

struct chebyshev_lanes {
    vfloat field[N_FIELDS];
    unsigned live;
};

// Rays that have their pieces and wait for lanes. N_BORN: the steps that each has taken.
struct ray_pieces {
    float field[N_FIELDS][2 * LANES];
    int next, count;
};

static inline vdouble v_double_along(vdouble origin, vdouble direction, vdouble t) {
    return (vdouble){v_half_madd(direction.low, t.low, origin.low),
                     v_half_madd(direction.high, t.high, origin.high)};
}

KERNEL_SHARED void queue_close(vmask m, vfloat ray, vfloat t, vfloat rest, vfloat had,
                               struct worker_scratch *scratch);
KERNEL_SHARED void march_chebyshev(const struct primitive *s, const struct limits *limits,
                                   struct chebyshev_lanes *lanes, struct ray_pieces *pieces,
                                   float *steps, struct worker_scratch *scratch);
// bulb/chebyshev_pieces.c
KERNEL_SHARED void prepare_pieces(struct worker_scratch *scratch, struct ray_pieces *to);

#endif
