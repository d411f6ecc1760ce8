// AVX2 for WebAssembly's 128-bit SIMD, by SIMDe (common/simd/x86). A multiply-add is two operations: WebAssembly has
// no fused one, and SIMDe's calls libm for every lane.
#pragma once

#include "../../common/simd/x86/immintrin.h"

#undef _mm256_fmadd_ps
#undef _mm256_fnmadd_ps
#undef _mm256_fmsub_ps
#undef _mm256_fmadd_pd
#undef _mm256_fnmadd_pd
#define _mm256_fmadd_ps(a, b, c) ((a) * (b) + (c))
#define _mm256_fnmadd_ps(a, b, c) ((c) - (a) * (b))
#define _mm256_fmsub_ps(a, b, c) ((a) * (b) - (c))
#define _mm256_fmadd_pd _mm256_fmadd_ps
#define _mm256_fnmadd_pd _mm256_fnmadd_ps
