// Camera rays that are close to a Mandelbulb march on polynomials: see bulb/bulb_chebyshev.c.
#ifndef BULB_CHEBYSHEV_H
#define BULB_CHEBYSHEV_H

#include "core/primitive.h"
#include "simd/simd.h"

struct ray_queues; // core/ray_queues.h

// From such an estimate on a ray is close, and until such a one at the end of its piece. Not by the step, which may be
// short over a plane: far out, where the first iteration has escaped, chebyshev_orbit()'s estimate is too short.
#define CLOSE_ESTIMATE 5e-3f
enum { CLOSE_TERMS = 6, CLOSE_VALUES = 4 }; // x, y, z and the derivative

// What a lane knows; all from the middle of its piece.
enum chebyshev_field {
    N_TERM, // the constants of all that is told, then the factors of t …
    N_PLACE = CLOSE_VALUES * CLOSE_TERMS,
    N_DIRECTION = N_PLACE + 3,
    N_T = N_DIRECTION + 3,
    N_PIECE_END, // of the piece, or of the ray
    N_RAY_END,   // of the ray
    N_HEIGHT,
    N_SLOPE,
    N_MIDDLE,
    N_RAY, // which one on the desk
    N_EVALS,
    N_FIELDS
};

struct chebyshev_lanes {
    vfloat field[N_FIELDS];
    unsigned live;
};

// Rays that have their pieces, and wait for lanes.
struct ray_pieces {
    float field[N_FIELDS][2 * LANES];
    int next, count;
};

static inline vdouble v_double_along(vdouble origin, vdouble direction, vdouble t) {
    return (vdouble){v_half_madd(direction.low, t.low, origin.low),
                     v_half_madd(direction.high, t.high, origin.high)};
}

// The rays of the lanes in m wait for their next pieces. t is two floats.
void queue_close(vmask m, vfloat ray, vfloat t, vfloat t_lo, vfloat evals,
                 struct ray_queues *queues);
// Where a ray's march is over: for resume_march(). t: from where it is nearest to the centre. What goes on among the other shapes
// may have come below the plane by its last step, and be behind the camera.
void store_march_result(struct ray_queues *queues, int ray, double t, float evals, float found);
// Of a packet's lanes that are over what store_march_result() wants: what has come to the plane is to ask there again.
void march_outcome(vmask met, vmask reached, vfloat evals, vfloat cap, float counted[LANES],
                   float found[LANES]);
// Marches the rays that wait, until none does: to the end, unless some are to be marched in floats before.
void march_chebyshev(const struct primitive *s, vfloat hit_distance, vfloat cap,
                     struct chebyshev_lanes *lanes, struct ray_pieces *pieces,
                     struct ray_queues *queues);

#endif
