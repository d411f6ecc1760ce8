// The march of rays close to a Mandelbulb, by polynomials along pieces of each ray: bulb/bulb_chebyshev.c and
// bulb/chebyshev_pieces.c.
#pragma once

#include "bulb/bulb_steps.h"
#include "simd/simd.h"
#include "types/known_scene.h"

struct worker_scratch;

// A ray is close once its estimate is below this. The step is no measure: over a plane it may be short far
// from the bulb, where chebyshev_orbit() is wrong because the first iteration has escaped.
#define CLOSE_ESTIMATE 5e-3f

// Steps are counted in floats, which cannot count past 2^24. At this count it restarts at 0, and N_STEPS is
// shifted to match.
#define STEPS_COUNTED 0x1p23f

// x, y, z with CLOSE_TERMS each, and the derivative with SLOPE_TERMS.
enum { CLOSE_TERMS = 6, SLOPE_TERMS = 4, CLOSE_VALUES = 4, POLYNOMIALS = 3 };

// The fields of a lane. Distances along the ray count from the middle of its piece.
enum chebyshev_field {
    N_TERM, // coefficients of x, y and z: the constants, then the factors of t, of t² …
    N_SLOPE_TERM = POLYNOMIALS * CLOSE_TERMS,
    N_PLACE = N_SLOPE_TERM + SLOPE_TERMS,
    N_DIRECTION = N_PLACE + 3,
    N_T = N_DIRECTION + 3,
    N_END, // of the piece, or of the ray
    N_TO,  // of the ray
    N_HEIGHT,
    N_SLOPE,
    N_MIDDLE,
    N_RAY,   // its index in scratch->bulb
    N_STEPS, // lane: the step count at its start
    N_STATE, // of close_step()
    N_FIELDS = N_STATE + STEP_FIELDS
};

// A packet: chebyshev_field of each lane, and a bit for each lane in use.
struct chebyshev_lanes {
    vfloat field[N_FIELDS];
    unsigned live;
};

// Rays that have their pieces and wait for lanes. N_STEPS: those that each has taken.
struct ray_pieces {
    float field[N_FIELDS][2 * LANES];
    int next, count;
};

// Queues the rays of the lanes in m for their next pieces. t and rest: the distance as two floats. had: steps
// taken.
KERNEL_SHARED void queue_close(vmask m, vfloat ray, vfloat t, vfloat rest, vfloat had,
                               struct worker_scratch *scratch);
// Marches the close rays until none waits. Returns with rays still in lanes if too few are left to fill them
// and some rays wait for the march in floats. steps: the count of all steps, kept between calls.
KERNEL_SHARED void march_chebyshev(const struct primitive *s, const struct limits *limits,
                                   struct chebyshev_lanes *lanes, struct ray_pieces *pieces,
                                   float *steps, struct worker_scratch *scratch);
// Computes the next pieces of the first LANES rays that wait, or fewer (bulb/chebyshev_pieces.c).
KERNEL_SHARED void prepare_pieces(struct worker_scratch *scratch, struct ray_pieces *to);
