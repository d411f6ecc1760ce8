// flags: -DLANES=8 -mavx2 -mfma -ffp-contract=off
#ifdef __x86_64__
#define NEEDED (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
#else
#define NEEDED true
#endif
#include "simd_lanes.h"
