// Numbers that are the same in every run: after xorshift32 (G. Marsaglia, "Xorshift RNGs", 2003).
#pragma once

#include <stdint.h>

static uint32_t seed = 1;

static double random_from(double least, double most) {
    seed ^= seed << 13;
    seed ^= seed >> 17;
    seed ^= seed << 5;
    return least + (most - least) * (seed * 0x1p-32);
}
