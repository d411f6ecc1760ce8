// Roots by way of a float's bits. Its bits, read as a whole number, are its logarithm but for a few percent, so that
// halving them is a root: J. F. Blinn, "Floating-point tricks", IEEE CG&A 17 (1997); the constant of 1/√ is Quake
// III's. Numbers become floats as C. Hecker tells ("Let's get to the (floating) point", Game Developer, 1996):
// beside a set exponent a fixed-point number is a mantissa, less the float that the exponent is alone.
#ifndef FIXED_ROOTS_H
#define FIXED_ROOTS_H

// √a for 0 ≤ a < 2^near, as the article has it: no Newton step, up to 6 % too large.
static inline num article_root(num a, const struct format *f) {
    const num whole = set((int64_t)(127 + f->near) << 23);
    const float alone = (float)(1 << f->near);
    num x = add_float(or_bits(and_bits(a, set(0x7fffff)), whole), -alone);
    x = plus(right(x, 1), set((1 << 29) - (1 << 22)));
    return and_bits(add_float(x, alone), set(0x7fffff));
}

// 1/√a for least ≤ a < 2^wide, as the article has it: two Newton steps.
static inline num article_inverse_root(num a, const struct format *f) {
    const num whole = set((int64_t)(127 + f->wide) << 23), three = set((int64_t)3 << (f->bits - 1));
    const float alone = (float)(1 << f->wide);
    num x = right(left(a, f->from_wide), f->to_wide);
    x = add_float(or_bits(and_bits(x, set(0x7fffff)), whole), -alone);
    x = add_float(minus(set(0x5f3759df), right(x, 1)), alone);
    x = right(left(and_bits(x, set(0x7fffff)), f->to_wide), f->from_wide);
    a = half_of(a);
    for (int i = 0; i < 2; i++)
        x = times(x, minus(three, times(times(x, x, f), a, f)), f);
    return x;
}

// 1/√a of a whole number 0 < a < 2^62 is y·2^-30·2^-h; a itself m·2^-29·4^h with 1 ≤ m < 4.
struct inverse {
    num y, h, m;
};

// The article's way with the bits of a double, for any range: what is iterated is brought to 1 ≤ m < 4, with 30 bits of
// fraction whatever the format has.
static inline struct inverse inverse_root(num a, const struct format *f) {
    struct inverse r;
    num x = as_double(a);
    r.h = right(minus(right(x, 52), set(1023)), 1);
    num up = minus(set(29), plus(r.h, r.h));
    r.m = or_bits(left_each(a, up), right_each(a, minus(set(0), up)));
    num y = minus(set(0x5fe6eb50c7b537a9), right(x, 1));
    y = plus(y, left(plus(r.h, set(30)), 52));
    y = and_bits(add_double(y, 0x1p52), set(0xfffffffffffff));
    for (int i = 0; i < f->steps; i++) {
        num error = shifted(product(r.m, shifted(product(y, y), 30)), 30); // m·y²/2, of 30 bits
        y = shifted(product(y, minus(set(3 << 29), error)), 30);
    }
    r.y = y;
    return r;
}

// √a for 0 < a < 2^(62 − 2·bits).
static inline num root(num a, const struct format *f) {
    if (f->steps == 0)
        return article_root(a, f);
    struct inverse r = inverse_root(left(a, f->bits), f);
    return right_each(product(r.m, r.y), minus(set(59), r.h));
}

// 1/|v| as a factor and its bits of fraction: as many as the format has, or as few as leave it one where |v| is small.
struct per {
    num factor, fraction;
};

// a/|v|
static inline num over(num a, struct per per) {
    return shifted_each(product(a, per.factor), per.fraction);
}

// v/|v|, and 1/|v|; 0 where v is.
static inline struct vec normalised(struct vec v, const struct format *f, struct per *per) {
    if (f->steps == 0) {
        num x = article_inverse_root(greatest(sum3(v, v, f), set(f->least)), f);
        *per = (struct per){x, set(f->bits)};
        return (struct vec){times(v.x, x, f), times(v.y, x, f), times(v.z, x, f)};
    }
    num square = plus(plus(product(v.x, v.x), product(v.y, v.y)), product(v.z, v.z));
    struct inverse r = inverse_root(greatest(square, set(1)), f);
    num down = minus(plus(r.h, set(30)), set(f->bits));
    num more = greatest(minus(down, set(f->bits)), set(0));
    *per = (struct per){right_each(r.y, more), minus(down, more)};
    return (struct vec){shifted_each(product(v.x, r.y), down),
                        shifted_each(product(v.y, r.y), down),
                        shifted_each(product(v.z, r.y), down)};
}

#endif
