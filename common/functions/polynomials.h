// Elementary functions by range reduction and a polynomial. log, exp and pow are copies of those in
// phases/opt3 and phases/opt4; tests/c/functions/test_functions_double.c and test_functions_float.c check that
// they agree bit for bit. sin, cos, atan2 and acos follow the same scheme: W. J. Cody and W. Waite,
// "Software manual for the elementary functions" (1980). scripts/stepwise polynomials and
// scripts/study/experiments/functions/coefficients.py compute the coefficients.
//
// The functions serve a renderer: outside the stated ranges, and for infinities and NaN, the result
// can be any finite number.
#pragma once

#include "coefficients.h"
#include "simd.h"

// Evaluates a polynomial by Horner's scheme; `c` has the lowest power first.
#define HORNER(C, U) horner(C, sizeof C / sizeof *C, U)
static inline __attribute__((always_inline)) V horner(const elem *c, size_t terms, V u) {
    V p = vsplat(c[terms - 1]);
#pragma GCC unroll 16
    for (size_t i = terms - 1; i-- > 0;)
        p = vfma(u, p, vsplat(c[i]));
    return p;
}

#if DOUBLE
// 1.5·2^52: adding it rounds to a whole number and leaves that number in the low bits.
#define SHIFT 6755399441055744.0

static inline V poly_log(V a) {
    I raw = (I)a;
    V e = (V)(((raw >> 52) & isplat(0xfff)) | isplat(0x4330000000000000)) -
          (4503599627370496.0 + 1023);
    V m = (V)((raw & isplat(0x000fffffffffffff)) | isplat(0x3ff0000000000000));
    I high = (I)(m > vsplat(1.4142135623730951));
    m = vselect(high, m * 0.5, m);
    e = e + (V)(high & (I)vsplat(1.0));
    V f = m - 1.0, s = f / (m + 1.0), u = s * s, u2 = u * u;
    V low = vfma(u, vsplat(0.3999999999989950449), vsplat(0.66666666666666696862));
    V mid = vfma(u, vsplat(0.22222211134795079855), vsplat(0.28571428625975484921));
    V top = vfma(u, vsplat(0.15331721600556041269), vsplat(0.1818288912526172208));
    top = vfma(u2, vsplat(0.1461644968504340586), top);
    V p = vfma(u2 * u2, top, vfma(u2, mid, low));
    V rest = MM(fmsub)(e, vsplat(7.440617110012397e-11), s * vfnma(u, p, f));
    return vfma(e, vsplat(0.6931471804855391), f + rest);
}

static inline V poly_exp(V a) {
    static const elem q[] = {0.50000000000000010211,     0.16666666666666667452,
                             0.041666666666624161903,    0.0083333333333300644495,
                             0.0013888888917196719077,   0.00019841269863040545271,
                             0.000024801521322368693266, 2.7557268480310025526e-6,
                             2.7620075879983366586e-7,   2.5100375832561233664e-8};
    a = MM(min)(MM(max)(a, vsplat(-708.0)), vsplat(709.0));
    V shifted = vfma(a, vsplat(1.4426950408889634), vsplat(SHIFT)), n = shifted - SHIFT;
    V r = vfnma(n, vsplat(0.6931471804855391), a);
    r = vfnma(n, vsplat(7.440617110012397e-11), r);
    V e = 1.0 + vfma(r * r, HORNER(q, r), r);
    return (V)((I)e + ((I)shifted << 52));
}
#else
#define SHIFT 12582912.0f

static inline V poly_log(V a) {
    I raw = (I)a;
    V e = __builtin_convertvector(((raw >> 23) & isplat(0x1ff)) - isplat(127), V);
    V m = (V)((raw & isplat(0x007fffff)) | isplat(0x3f800000));
    I high = (I)(m > vsplat(1.41421356f));
    m = vselect(high, m * 0.5f, m);
    e = e + (V)(high & (I)vsplat(1.0f));
    V f = m - 1.0f, s = f / (m + 1.0f), u = s * s;
    V p = vfma(u, vsplat(0.29579949392f), vsplat(0.39988780566f));
    p = vfma(u, p, vsplat(0.6666668504f));
    V rest = MM(fmsub)(e, vsplat(-2.12194440e-4f), s * vfnma(u, p, f));
    return vfma(e, vsplat(0.693359375f), f + rest);
}

static inline V poly_exp(V a) {
    static const elem q[] = {0.5f, 0.16666577026f, 0.041666554662f, 0.0083631730745f,
                             0.001392617612f};
    a = MM(min)(MM(max)(a, vsplat(-87.0f)), vsplat(88.0f));
    V shifted = a * 1.44269504f + SHIFT, n = shifted - SHIFT;
    V r = vfnma(n, vsplat(0.693359375f), a);
    r = vfnma(n, vsplat(-2.12194440e-4f), r);
    V e = 1.0f + vfma(r * r, HORNER(q, r), r);
    return (V)((I)e + ((I)shifted << 23));
}
#endif

static inline V poly_pow(V a, V b) {
    return poly_exp(b * poly_log(a));
}

// Splits x = n·π/2 + r with |r| ≤ π/4; returns the low bits of n. Accurate for |n| < 2^14 in float
// and 2^17 in double.
static inline I quarter_turns(V x, V *r) {
    V shifted = vfma(x, vsplat((elem)0.63661977236758134308), vsplat(SHIFT)), n = shifted - SHIFT;
    *r = vfnma(n, vsplat(HALF_PI[0]), x);
    *r = vfnma(n, vsplat(HALF_PI[1]), *r);
    *r = vfnma(n, vsplat(HALF_PI[2]), *r);
    return (I)shifted;
}

// sin(turns·π/2 + r).
static inline V sine_of(I turns, V r) {
    V u = r * r, one = vsplat(1);
    V sine = vfma(r * u, HORNER(SIN, u), r);
    V cosine = vfma(u, vfma(u, HORNER(COS, u), vsplat((elem)-0.5)), one);
    I odd = (turns & isplat(1)) != isplat(0), negative = (turns & isplat(2)) != isplat(0);
    return (V)((I)vselect(odd, cosine, sine) ^ (negative & (I)vsplat((elem)-0.0)));
}

static inline V poly_sin(V x) {
    V r;
    I turns = quarter_turns(x, &r);
    return sine_of(turns, r);
}

static inline V poly_cos(V x) {
    V r;
    I turns = quarter_turns(x, &r);
    return sine_of(turns + isplat(1), r);
}

// Reduces to atan(small / large) with small ≤ large, and expands it about 0 or 1, whichever is nearer.
// Both cases share one division.
static inline V poly_atan2(V y, V x) {
    V ax = vabs(x), ay = vabs(y);
    I steep = (I)(ay > ax);
    V large = vselect(steep, ay, ax), small = vselect(steep, ax, ay);
    I about_one = (I)(small > large * (elem)0.41421356237309504880);
    V top = vselect(about_one, small - large, small),
      bottom = vselect(about_one, small + large, large);
    V t = (V)(~(I)(bottom == vsplat(0)) & (I)(top / bottom)); // 0/0 counts as 0
    V u = t * t, tail = t * u * HORNER(ATAN, u);
    // The offset's low part is added to the tail; its high part is added last, for accuracy.
    V high = (V)(about_one & (I)vsplat(HALF_PI[0] / 2)),
      low = (V)(about_one & (I)vsplat(HALF_PI[1] / 2));
    V angle_high = high, angle_low = low + tail;
    V flip = vselect(steep, vsplat(-1), vsplat(1)); // π/2 − angle
    angle_high = vfma(flip, high, (V)(steep & (I)vsplat(HALF_PI[0])));
    angle_low = vfma(flip, angle_low, (V)(steep & (I)vsplat(HALF_PI[1])));
    t = t * flip;
    I behind = ((I)x >> (8 * sizeof(elem) - 1)); // π − angle, also for x = −0
    flip = vselect(behind, vsplat(-1), vsplat(1));
    angle_high = vfma(flip, angle_high, (V)(behind & (I)vsplat(2 * HALF_PI[0])));
    angle_low = vfma(flip, angle_low, (V)(behind & (I)vsplat(2 * HALF_PI[1])));
    V angle = angle_high + vfma(t, flip, angle_low);
    return (V)((I)angle | sign_bits(y));
}

static inline V poly_acos(V x) {
    V a = vabs(x);
    I outer = (I)(a > vsplat((elem)0.5)), left = (I)(x < vsplat(0));
    V z = vselect(outer, (1 - a) * (elem)0.5, a * a), s = vselect(outer, MM(sqrt)(z), a);
    V tail = s * z * HORNER(ASIN, z);
    V middle = vselect(left, vsplat(-1), vsplat(1));
    // |x| ≤ 1/2: π/2 − asin x. x > 1/2: 2·asin √((1 − x)/2). x < −1/2: π − acos(−x).
    V inner = vsplat(HALF_PI[0]) - vfma(middle, s, vfma(middle, tail, vsplat(-HALF_PI[1])));
    V twice = 2 * (s + tail);
    V mirrored = 2 * (vsplat(HALF_PI[0]) - (s + (tail - vsplat(HALF_PI[1]))));
    return vselect(outer, vselect(left, mirrored, twice), inner);
}
