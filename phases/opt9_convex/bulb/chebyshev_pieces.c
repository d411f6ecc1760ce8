// The pieces of opt9_convex's rays: simd/bulb_pieces.h. The derivative has a polynomial of its own.
#include "bulb/bulb_chebyshev.h"
#include "bulb/bulb_estimate.h"

#define BULB_SCRATCH struct worker_scratch
#include "simd/bulb_pieces.h"

// Stores the polynomial of the derivative: the Chebyshev series of its values, cut after SLOPE_TERMS. It only
// scales the estimate: a step's length errs by less than 2^-19 of itself (tests/phases/test_bulb_chebyshev.py).
static inline void store_slope(const vdouble sum[3], const vdouble difference[3],
                               const vfloat power[CLOSE_TERMS], struct ray_pieces *to) {
    static const double slope[SLOPE_TERMS][3] = {
        {-0.12200846792814626, 0.16666666666666657, 0.45534180126147961},
        {-0.38513150575685806, 0.94280904158206325, 0.79337979622072108},
        {0.57735026918962584, 0.0, -0.57735026918962584},
        {0.94280904158206325, -0.94280904158206325, -0.94280904158206325}};
    for (int k = 0; k < SLOPE_TERMS; k++) {
        const vdouble *value = k % 2 ? difference : sum;
        vdouble term = v_double_madd(
            value[0], slope[k][0],
            v_double_madd(value[1], slope[k][1], v_double_mul(value[2], slope[k][2])));
        vfloat factor = v_double_to_float(term);
        if (k > 0)
            factor = factor * power[k];
        v_store(factor, to->field[N_SLOPE_TERM + k]);
    }
}
