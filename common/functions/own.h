// Own log, exp, pow (copies of what phases/opt3 and phases/opt4 have: tests/c/test_functions_own*.c
// holds them equal, bit by bit) and sin, cos, atan2, acos of the same make: range reduction after
// W. J. Cody and W. Waite, "Software manual for the elementary functions" (1980), polynomials by
// scripts/polynomials.py and scripts/study/functions_coefficients.py. They are made for a
// renderer's arguments: outside the ranges said here, and at infinities and NaN, they may answer
// anything finite.
#ifndef STEPWISE_FUNCTIONS_OWN_H
#define STEPWISE_FUNCTIONS_OWN_H

#include "coefficients.h"
#include "simd.h"

// Horner's scheme, lowest power first in `c`.
#define HORNER(C, U) horner(C, sizeof C / sizeof *C, U)
static inline __attribute__((always_inline)) V horner(const elem *c, size_t terms, V u) {
    V p = vset(c[terms - 1]);
#pragma GCC unroll 16
    for (size_t i = terms - 1; i-- > 0;)
        p = fma_(u, p, vset(c[i]));
    return p;
}

#if DOUBLE
// 1.5·2^52: adding it rounds to a whole number, which is then in the low bits.
#define SHIFT 6755399441055744.0

static inline V own_log(V a) {
    I raw = (I)a;
    V e = (V)(((raw >> 52) & iset(0xfff)) | iset(0x4330000000000000)) - (4503599627370496.0 + 1023);
    V m = (V)((raw & iset(0x000fffffffffffff)) | iset(0x3ff0000000000000));
    I high = (I)(m > vset(1.4142135623730951));
    m = pick(high, m * 0.5, m);
    e = e + (V)(high & (I)vset(1.0));
    V f = m - 1.0, s = f / (m + 1.0), u = s * s, u2 = u * u;
    V low = fma_(u, vset(0.3999999999989950449), vset(0.66666666666666696862));
    V mid = fma_(u, vset(0.22222211134795079855), vset(0.28571428625975484921));
    V top = fma_(u, vset(0.15331721600556041269), vset(0.1818288912526172208));
    top = fma_(u2, vset(0.1461644968504340586), top);
    V p = fma_(u2 * u2, top, fma_(u2, mid, low));
    V rest = MM(fmsub)(e, vset(7.440617110012397e-11), s * fnma(u, p, f));
    return fma_(e, vset(0.6931471804855391), f + rest);
}

static inline V own_exp(V a) {
    static const elem q[] = {0.50000000000000010211,     0.16666666666666667452,
                             0.041666666666624161903,    0.0083333333333300644495,
                             0.0013888888917196719077,   0.00019841269863040545271,
                             0.000024801521322368693266, 2.7557268480310025526e-6,
                             2.7620075879983366586e-7,   2.5100375832561233664e-8};
    a = MM(min)(MM(max)(a, vset(-708.0)), vset(709.0));
    V shifted = fma_(a, vset(1.4426950408889634), vset(SHIFT)), n = shifted - SHIFT;
    V r = fnma(n, vset(0.6931471804855391), a);
    r = fnma(n, vset(7.440617110012397e-11), r);
    V e = 1.0 + fma_(r * r, HORNER(q, r), r);
    return (V)((I)e + ((I)shifted << 52));
}
#else
#define SHIFT 12582912.0f

static inline V own_log(V a) {
    I raw = (I)a;
    V e = __builtin_convertvector(((raw >> 23) & iset(0x1ff)) - iset(127), V);
    V m = (V)((raw & iset(0x007fffff)) | iset(0x3f800000));
    I high = (I)(m > vset(1.41421356f));
    m = pick(high, m * 0.5f, m);
    e = e + (V)(high & (I)vset(1.0f));
    V f = m - 1.0f, s = f / (m + 1.0f), u = s * s;
    V p = fma_(u, vset(0.29579949392f), vset(0.39988780566f));
    p = fma_(u, p, vset(0.6666668504f));
    V rest = MM(fmsub)(e, vset(-2.12194440e-4f), s * fnma(u, p, f));
    return fma_(e, vset(0.693359375f), f + rest);
}

static inline V own_exp(V a) {
    static const elem q[] = {0.5f, 0.16666577026f, 0.041666554662f, 0.0083631730745f,
                             0.001392617612f};
    a = MM(min)(MM(max)(a, vset(-87.0f)), vset(88.0f));
    V shifted = a * 1.44269504f + SHIFT, n = shifted - SHIFT;
    V r = fnma(n, vset(0.693359375f), a);
    r = fnma(n, vset(-2.12194440e-4f), r);
    V e = 1.0f + fma_(r * r, HORNER(q, r), r);
    return (V)((I)e + ((I)shifted << 23));
}
#endif

static inline V own_pow(V a, V b) {
    return own_exp(b * own_log(a));
}

// x = n·π/2 + r with |r| ≤ π/4; n's low bits. Good for |n| < 2^14 in float, 2^17 in double.
static inline I quarter_turns(V x, V *r) {
    V shifted = fma_(x, vset((elem)0.63661977236758134308), vset(SHIFT)), n = shifted - SHIFT;
    *r = fnma(n, vset(HALF_PI[0]), x);
    *r = fnma(n, vset(HALF_PI[1]), *r);
    *r = fnma(n, vset(HALF_PI[2]), *r);
    return (I)shifted;
}

// sin of (turns·π/2 + r)
static inline V sine_of(I turns, V r) {
    V u = r * r, one = vset(1);
    V sine = fma_(r * u, HORNER(SIN, u), r);
    V cosine = fma_(u, fma_(u, HORNER(COS, u), vset((elem)-0.5)), one);
    I odd = (turns & iset(1)) != iset(0), negative = (turns & iset(2)) != iset(0);
    return (V)((I)pick(odd, cosine, sine) ^ (negative & (I)vset((elem)-0.0)));
}

static inline V own_sin(V x) {
    V r;
    I turns = quarter_turns(x, &r);
    return sine_of(turns, r);
}

static inline V own_cos(V x) {
    V r;
    I turns = quarter_turns(x, &r);
    return sine_of(turns + iset(1), r);
}

// atan of small / large ≤ 1 about 0 or about 1, whichever is nearer: one division for both.
static inline V own_atan2(V y, V x) {
    V ax = magnitude(x), ay = magnitude(y);
    I steep = (I)(ay > ax);
    V large = pick(steep, ay, ax), small = pick(steep, ax, ay);
    I about_one = (I)(small > large * (elem)0.41421356237309504880);
    V top = pick(about_one, small - large, small), bottom = pick(about_one, small + large, large);
    V t = (V)(~(I)(bottom == vset(0)) & (I)(top / bottom)); // 0/0 counts as 0
    V u = t * t, tail = t * u * HORNER(ATAN, u);
    // the offset's low part joins the tail, its high part comes last
    V high = (V)(about_one & (I)vset(HALF_PI[0] / 2)),
      low = (V)(about_one & (I)vset(HALF_PI[1] / 2));
    V angle_high = high, angle_low = low + tail;
    V flip = pick(steep, vset(-1), vset(1)); // π/2 − angle
    angle_high = fma_(flip, high, (V)(steep & (I)vset(HALF_PI[0])));
    angle_low = fma_(flip, angle_low, (V)(steep & (I)vset(HALF_PI[1])));
    t = t * flip;
    I behind = ((I)x >> (8 * sizeof(elem) - 1)); // π − angle, for −0 too
    flip = pick(behind, vset(-1), vset(1));
    angle_high = fma_(flip, angle_high, (V)(behind & (I)vset(2 * HALF_PI[0])));
    angle_low = fma_(flip, angle_low, (V)(behind & (I)vset(2 * HALF_PI[1])));
    V angle = angle_high + fma_(t, flip, angle_low);
    return (V)((I)angle | sign_bits(y));
}

static inline V own_acos(V x) {
    V a = magnitude(x);
    I outer = (I)(a > vset((elem)0.5)), left = (I)(x < vset(0));
    V z = pick(outer, (1 - a) * (elem)0.5, a * a), s = pick(outer, MM(sqrt)(z), a);
    V tail = s * z * HORNER(ASIN, z);
    V middle = pick(left, vset(-1), vset(1));
    // |x| ≤ 1/2: π/2 ∓ asin; x > 1/2: 2·asin √; x < −1/2: π − that
    V inner = vset(HALF_PI[0]) - fma_(middle, s, fma_(middle, tail, vset(-HALF_PI[1])));
    V twice = 2 * (s + tail);
    V mirrored = 2 * (vset(HALF_PI[0]) - (s + (tail - vset(HALF_PI[1]))));
    return pick(outer, pick(left, mirrored, twice), inner);
}

#endif
