// Camera rays that are close to a Mandelbulb march on polynomials: see bulb/bulb_chebyshev.c.
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

struct ray_queues; // core/ray_queues.h

// A ray is close below CLOSE_ESTIMATE, until its estimate is above LEAVE_ESTIMATE at the end of its piece. The step
// does not decide: over a plane it may be short far out, where chebyshev_orbit()'s estimate is too short.
#define CLOSE_ESTIMATE 5e-3f
enum { CLOSE_TERMS = 6, CLOSE_VALUES = 4, POLYNOMIALS = 4 }; // x, y, z and the derivative

// The fields of a lane. Distances count from the middle of its piece.
enum chebyshev_field {
    N_TERM, // the constant terms of all values, then the factors of t, t² …
    N_PLACE = CLOSE_VALUES * CLOSE_TERMS,
    N_DIRECTION = N_PLACE + 3,
    N_T = N_DIRECTION + 3,
    N_END, // end of the piece, or of the ray
    N_TO,  // end of the ray
    N_HEIGHT,
    N_SLOPE,
    N_MIDDLE,
    N_RAY, // its index in queues->bulb
    N_STEPS,
    N_FIELDS,
    N_STATE = N_FIELDS // no more of a step
};

struct chebyshev_lanes {
    vfloat field[N_FIELDS];
    unsigned live;
};

// Rays that have a piece and wait for a lane.
struct ray_pieces {
    float field[N_FIELDS][2 * LANES];
    int next, count;
};

// Queues the rays of the lanes in m for their next pieces. t and rest: the distance as two floats. had: steps taken.
void queue_close(vmask m, vfloat ray, vfloat t, vfloat rest, vfloat had,
                 struct ray_queues *scratch);
// Stores the result of a ray's march, for resume_march(). t counts from the point nearest to the centre. A ray that
// marches on may have come below the plane by its last step, and so be behind the camera.
void store_march_result(struct ray_queues *queues, int ray, double t, float evals, float found);
// Sets the results of a packet's ended lanes, as store_march_result() takes them. A ray at the plane evaluates its
// last step again.
void march_outcome(vmask met, vmask reached, vfloat evals, vfloat cap, float counted[LANES],
                   float found[LANES]);
// Marches the rays that wait to their ends. Returns earlier if rays must be marched in floats first.
void march_chebyshev(const struct primitive *s, vfloat hit_distance, vfloat cap,
                     struct chebyshev_lanes *lanes, struct ray_pieces *pieces,
                     struct ray_queues *queues);
