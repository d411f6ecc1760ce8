// Square roots from the bits of a float. Read as an integer, a float's bits are its logarithm within a few percent,
// so halving them gives a root: J. F. Blinn, "Floating-point tricks", IEEE CG&A 17 (1997). The constant of 1/√ is
// Quake III's. A fixed-point number becomes a float by C. Hecker's trick ("Let's get to the (floating) point", Game
// Developer, 1996): placed beside a fixed exponent it is a mantissa, and the float of that exponent is subtracted.
// Included by number.h, whose operations it uses.
#pragma once

enum { MANTISSA = 0x7fffff, EXPONENT_BIAS = 127, EXPONENT_SHIFT = 23 }; // of a float

// Returns √a for 0 ≤ a < 2^sqrt_whole_bits as the article computes it: no Newton step, up to 6.1 % too large.
static inline vnum article_sqrt(vnum a, const struct format *f) {
    const vnum exponent = v_splat((int64_t)(EXPONENT_BIAS + f->sqrt_whole_bits) << EXPONENT_SHIFT);
    const float offset = (float)(1 << f->sqrt_whole_bits);
    vnum x = v_add_float(v_or_bits(v_and_bits(a, v_splat(MANTISSA)), exponent), -offset);
    x = v_add(v_srl(x, 1), v_splat((1 << 29) - (1 << 22)));
    return v_and_bits(v_add_float(x, offset), v_splat(MANTISSA));
}

// Returns 1/√a for rsqrt_least ≤ a < 2^rsqrt_whole_bits as the article computes it: two Newton steps.
static inline vnum article_rsqrt(vnum a, const struct format *f) {
    const vnum exponent = v_splat((int64_t)(EXPONENT_BIAS + f->rsqrt_whole_bits) << EXPONENT_SHIFT);
    const vnum three_halves = v_splat((int64_t)3 << (f->bits - 1));
    const float offset = (float)(1 << f->rsqrt_whole_bits);
    vnum x = v_srl(v_sll(a, f->rsqrt_shift_left), f->rsqrt_shift_right);
    x = v_add_float(v_or_bits(v_and_bits(x, v_splat(MANTISSA)), exponent), -offset);
    x = v_add_float(v_sub(v_splat(0x5f3759df), v_srl(x, 1)), offset);
    x = v_srl(v_sll(v_and_bits(x, v_splat(MANTISSA)), f->rsqrt_shift_right), f->rsqrt_shift_left);
    a = v_half(a);
    for (int i = 0; i < 2; i++)
        x = v_mul(x, v_sub(three_halves, v_mul(v_mul(x, x, f), a, f)), f);
    return x;
}

// 1/√a = y·2^-30·2^-h, and a = m·2^-29·4^h with 1 ≤ m·2^-29 < 4.
struct rsqrt {
    vnum y, h, m;
};

// Returns 1/√a of an integer 0 < a < 2^62, by the bits of a double and format->newton_steps Newton steps.
// It has no other range: the steps work on m, with 30 bits of fraction whatever the format has.
static inline struct rsqrt v_rsqrt(vnum a, const struct format *f) {
    struct rsqrt r;
    vnum x = v_double_bits(a);
    r.h = v_srl(v_sub(v_srl(x, 52), v_splat(1023)), 1);
    vnum up = v_sub(v_splat(29), v_add(r.h, r.h));
    r.m = v_or_bits(v_sllv(a, up), v_srlv(a, v_sub(v_splat(0), up)));
    vnum y = v_sub(v_splat(0x5fe6eb50c7b537a9), v_srl(x, 1));
    y = v_add(y, v_sll(v_add(r.h, v_splat(30)), 52));
    y = v_and_bits(v_add_double(y, 0x1p52), v_splat(0xfffffffffffff));
    for (int i = 0; i < f->newton_steps; i++) {
        vnum error = v_sra(v_mul_wide(r.m, v_sra(v_mul_wide(y, y), 30)), 30); // m·y²/2
        y = v_sra(v_mul_wide(y, v_sub(v_splat(3 << 29), error)), 30);
    }
    r.y = y;
    return r;
}

// Returns √a for 0 < a < 2^(62 − 2·bits).
static inline vnum v_root(vnum a, const struct format *f) {
    if (f->newton_steps == 0)
        return article_sqrt(a, f);
    struct rsqrt r = v_rsqrt(v_sll(a, f->bits), f);
    return v_srlv(v_mul_wide(r.m, r.y), v_sub(v_splat(59), r.h));
}

// 1/|v| as a factor below 2^31 with `fraction` bits of fraction: the format's bits, or fewer where |v| is small.
struct reciprocal {
    vnum factor, fraction;
};

// Returns a/|v|.
static inline vnum times_reciprocal(vnum a, struct reciprocal r) {
    return v_srav(v_mul_wide(a, r.factor), r.fraction);
}

// Returns v/|v|, or 0 if v is 0, and 1/|v| in `length`.
// The article's 1/√ gets at least rsqrt_least; the other one keeps |v|² in full, with 2·bits of fraction.
static inline struct vec normalize(struct vec v, const struct format *f,
                                   struct reciprocal *length) {
    if (f->newton_steps == 0) {
        vnum x = article_rsqrt(v_max(v_dot(v, v, f), v_splat(f->rsqrt_least)), f);
        *length = (struct reciprocal){x, v_splat(f->bits)};
        return (struct vec){v_mul(v.x, x, f), v_mul(v.y, x, f), v_mul(v.z, x, f)};
    }
    vnum square = v_add(v_add(v_mul_wide(v.x, v.x), v_mul_wide(v.y, v.y)), v_mul_wide(v.z, v.z));
    struct rsqrt r = v_rsqrt(v_max(square, v_splat(1)), f);
    vnum down = v_sub(v_add(r.h, v_splat(30)), v_splat(f->bits));
    vnum excess = v_max(v_sub(down, v_splat(f->bits)), v_splat(0));
    *length = (struct reciprocal){v_srlv(r.y, excess), v_sub(down, excess)};
    return (struct vec){v_srav(v_mul_wide(v.x, r.y), down), v_srav(v_mul_wide(v.y, r.y), down),
                        v_srav(v_mul_wide(v.z, r.y), down)};
}
