// flags: -DLANES=16 -mavx2 -mfma -mavx512f -mavx512dq -ffp-contract=off
#define NEEDED (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
#include "simd_lanes.h"
