// Floats of any finite bits, the same in every run.
#pragma once

#include <math.h>
#include <stdint.h>
#include <string.h>

// Knuth's MMIX LCG.
static float random_float(uint64_t *seed) {
    float value;
    do {
        *seed = *seed * 6364136223846793005u + 1442695040888963407u;
        uint32_t bits = (uint32_t)(*seed >> 32);
        memcpy(&value, &bits, sizeof value);
    } while (!isfinite(value));
    return value;
}
