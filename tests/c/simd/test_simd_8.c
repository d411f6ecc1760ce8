// flags: -DLANES=8 -mavx2 -mfma -ffp-contract=off
#define NEEDED (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
#include "simd_lanes.h"
