// Rays close to a Mandelbulb: the map's first iteration as polynomials along a piece of the ray, interpolated
// in doubles from CLOSE_TERMS points. It is a smooth function of t, and steps are short here. A step then
// errs by a float's rounding at the size of the piece, and by that of later iterations, over the derivative.
//
// The map is singular only on the axis ρ = 0. A ray meets the axis at a complex t, no nearer than ρ to a
// point at distance ρ from it. On pieces of half length ρ/32, 0.02 at most, the polynomials err by less than
// 2^-24 for ρ ≥ 1e-5 (tests/phases/test_bulb_chebyshev.py). Nearer to the axis the half length is CLOSE_PIECE_MIN, and at
// ρ = 1e-6 the error is up to 2e-5. Chebyshev points: Trefethen, Approximation Theory and Approximation
// Practice, 2013; distance to a singularity: its chapter 8.
#include "bulb/bulb_chebyshev.h"
#include "bulb/bulb_estimate.h"

#include <string.h>

#define CLOSE_PIECE 0.02f // half length of a piece, at most
#define CLOSE_PIECE_MIN 0x1p-20f
#define CLOSE_PIECE_SHARE 0.03125f // of ρ

static inline struct vec_double points_along(struct vec_double o, struct vec_double d, vdouble t) {
    return (struct vec_double){v_double_along(o.x, d.x, t), v_double_along(o.y, d.y, t),
                               v_double_along(o.z, d.z, t)};
}

static inline void lane0_double(struct vec_double place, vdouble to[CLOSE_VALUES]) {
    struct orbit_double low = bulb_first(place.x.low, place.y.low, place.z.low);
    struct orbit_double high = bulb_first(place.x.high, place.y.high, place.z.high);
    to[0] = (vdouble){low.x, high.x};
    to[1] = (vdouble){low.y, high.y};
    to[2] = (vdouble){low.z, high.z};
    to[3] = (vdouble){low.slope, high.slope};
}

static inline void store_term(const vdouble value[3], const double row[3],
                              const vfloat power[CLOSE_TERMS], int k, float *to) {
    vdouble term = v_double_madd(value[0], row[0],
                                 v_double_madd(value[1], row[1], v_double_mul(value[2], row[2])));
    vfloat factor = v_double_to_float(term);
    if (k > 0)
        factor = factor * power[k];
    v_store(factor, to);
}

// Stores the polynomial of one coordinate. Its even and odd coefficients are the sums and differences of the
// values at ±node·end, times the inverse of the matrix of the nodes' powers.
static inline void store_terms(const vdouble sum[3], const vdouble difference[3],
                               const vfloat power[CLOSE_TERMS], int axis, struct ray_pieces *to) {
    static const double even[3][3] = {
        {0.044658198738520484, -0.16666666666666696, 0.62200846792814624},
        {-0.75598306414370742, 2.6666666666666665, -1.9106836025229585},
        {1.333333333333333, -2.6666666666666661, 1.3333333333333328}};
    static const double odd[3][3] = {{0.046233569414009822, -0.23570226039551659, 2.40325617336917},
                                     {-0.7826512591014092, 3.7712361663282561, -7.3823145501758569},
                                     {1.3803682405467781, -3.7712361663282552, 5.151604406875034}};
    for (int k = 0; k < CLOSE_TERMS; k++)
        store_term(k % 2 ? difference : sum, k % 2 ? odd[k / 2] : even[k / 2], power, k,
                   to->field[N_TERM + POLYNOMIALS * k + axis]);
}

// Stores the polynomial of the derivative: the Chebyshev series of its values, cut after SLOPE_TERMS. It only
// scales the estimate: a step's length errs by less than 2^-19 of itself (tests/phases/test_bulb_chebyshev.py).
static inline void store_slope(const vdouble sum[3], const vdouble difference[3],
                               const vfloat power[CLOSE_TERMS], struct ray_pieces *to) {
    static const double slope[SLOPE_TERMS][3] = {
        {-0.12200846792814626, 0.16666666666666657, 0.45534180126147961},
        {-0.38513150575685806, 0.94280904158206325, 0.79337979622072108},
        {0.57735026918962584, 0.0, -0.57735026918962584},
        {0.94280904158206325, -0.94280904158206325, -0.94280904158206325}};
    for (int k = 0; k < SLOPE_TERMS; k++)
        store_term(k % 2 ? difference : sum, slope[k], power, k, to->field[N_SLOPE_TERM + k]);
}

// Stores the polynomials of the pieces of LANES rays, from their values at ±node·end about the middle.
static void store_pieces(struct vec_double o, struct vec_double d, vdouble middle, vfloat end,
                         vfloat per_end, struct ray_pieces *to) {
    static const double nodes[3] = {0.96592582628906831, 0.70710678118654757, 0.25881904510252074};
    vdouble sum[CLOSE_VALUES][3], difference[CLOSE_VALUES][3],
        reach = v_double_sum(end, v_splat(0.0f));
    for (int i = 0; i < 3; i++) {
        vdouble away = v_double_mul(reach, nodes[i]), before[CLOSE_VALUES], behind[CLOSE_VALUES];
        lane0_double(points_along(o, d, v_double_minus(middle, away)), before);
        lane0_double(points_along(o, d, v_double_plus(middle, away)), behind);
        for (int axis = 0; axis < CLOSE_VALUES; axis++) {
            sum[axis][i] = v_double_plus(behind[axis], before[axis]);
            difference[axis][i] = v_double_minus(behind[axis], before[axis]);
        }
    }
    vfloat power[CLOSE_TERMS] = {v_splat(1.0f), per_end};
    for (int k = 2; k < CLOSE_TERMS; k++)
        power[k] = power[k - 1] * per_end;
    for (int axis = 0; axis < POLYNOMIALS; axis++)
        store_terms(sum[axis], difference[axis], power, axis, to);
    store_slope(sum[3], difference[3], power, to);
}

void queue_close(vmask m, vfloat ray, vfloat t, vfloat rest, vfloat had,
                 struct worker_scratch *scratch) {
    if (scratch->close_count + 2 * LANES >
        CLOSE_ROOM) { // whole registers are read behind the last ray
        int left = scratch->close_count - scratch->close_first;
        for (int i = 0; i < C_FIELDS; i++)
            memmove(scratch->close[i], scratch->close[i] + scratch->close_first,
                    (size_t)left * sizeof(float));
        scratch->close_first = 0;
        scratch->close_count = left;
    }
    v_compress_store(m, ray, &scratch->close[C_RAY][scratch->close_count]);
    v_compress_store(m, t, &scratch->close[C_T][scratch->close_count]);
    v_compress_store(m, rest, &scratch->close[C_T_LOW][scratch->close_count]);
    v_compress_store(m, had, &scratch->close[C_HAD][scratch->close_count]);
    scratch->close_count += v_count(m);
}

void prepare_pieces(struct worker_scratch *scratch, struct ray_pieces *to) {
    int first = scratch->close_first, count = scratch->close_count - first;
    count = count < LANES ? count : LANES;
    float of[B_FIELDS][LANES];
    int rays[LANES];
    for (int lane = 0; lane < LANES; lane++)
        rays[lane] = (int)scratch->close[C_RAY][first + (lane < count ? lane : 0)];
    for (int i = 0; i < B_FIELDS; i++)
        for (int lane = 0; lane < LANES; lane++)
            of[i][lane] = scratch->bulb[i][rays[lane]];
    vdouble ray[6];
    for (int i = 0; i < 6; i++)
        ray[i] = v_double_sum(v_load(of[B_ORIGIN + i]), v_load(of[B_LOW + i]));
    struct vec_double o = {ray[0], ray[1], ray[2]}, d = {ray[3], ray[4], ray[5]};
    vdouble t =
        v_double_sum(v_load(&scratch->close[C_T][first]), v_load(&scratch->close[C_T_LOW][first]));
    struct vec_double place = points_along(o, d, t);
    vfloat x = v_double_to_float(place.x), z = v_double_to_float(place.z),
           rho = v_sqrt(v_madd(x, x, z * z));
    vfloat end = v_max(v_min(rho * v_splat(CLOSE_PIECE_SHARE), v_splat(CLOSE_PIECE)),
                       v_splat(CLOSE_PIECE_MIN));
    vfloat near_middle = v_double_to_float(t) + end;
    vdouble middle = v_double_sum(near_middle, v_splat(0.0f));
    store_pieces(o, d, middle, end, v_splat(1.0f) / end, to);
    place = points_along(o, d, middle);
    v_store(v_double_to_float(place.x), to->field[N_PLACE]);
    v_store(v_double_to_float(place.y), to->field[N_PLACE + 1]);
    v_store(v_double_to_float(place.z), to->field[N_PLACE + 2]);
    for (int i = 0; i < 3; i++)
        v_store(v_load(of[B_DIRECTION + i]), to->field[N_DIRECTION + i]);
    vfloat slope = v_load(of[B_SLOPE]);
    v_store(v_double_to_float(v_double_minus(t, middle)), to->field[N_T]);
    vfloat until = v_load(of[B_TO]) - near_middle;
    v_store(v_min(end, until), to->field[N_END]);
    v_store(until, to->field[N_TO]);
    v_store(v_madd(near_middle, slope, v_load(of[B_HEIGHT])), to->field[N_HEIGHT]);
    v_store(slope, to->field[N_SLOPE]);
    v_store(near_middle, to->field[N_MIDDLE]);
    v_store(v_load(&scratch->close[C_RAY][first]), to->field[N_RAY]);
    v_store(v_load(&scratch->close[C_HAD][first]), to->field[N_STEPS]);
    for (int i = N_STATE; i < N_FIELDS; i++)
        v_store(v_splat(0.0f), to->field[i]);
    to->next = 0;
    to->count = count;
    scratch->close_first += count;
}
