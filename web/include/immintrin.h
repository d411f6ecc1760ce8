// AVX2 for WebAssembly's 128-bit SIMD, by SIMDe (common/simd/x86), but for what is slow or wrong there.
#pragma once

#define SIMDE_ENABLE_NATIVE_ALIASES
#include <simde/simde-common.h>
// SIMDe's loops over lanes, unrolled: else LLVM 14 writes each lane to memory, and reads the whole vector back.
#undef SIMDE_VECTORIZE
#define SIMDE_VECTORIZE _Pragma("clang loop unroll(full)")

#include "../../common/simd/x86/immintrin.h"
#include <wasm_simd128.h>

// A multiply-add is two operations: WebAssembly has no fused one, and SIMDe's calls libm for every lane.
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

// LLVM 14 may move a load whose value is splatted behind a later store to the same place (of lane_of, which shares its
// place on the stack with the next one). The empty asm keeps load and splat apart.
#define WEB_SPLAT(name, type)                                                                      \
    static inline type web_##name(type a) {                                                        \
        if (!__builtin_constant_p(a))                                                              \
            __asm__("" : "+r"(a));                                                                 \
        return a;                                                                                  \
    }
WEB_SPLAT(float, float)
WEB_SPLAT(double, double)
WEB_SPLAT(int, int)
#undef WEB_SPLAT
#undef _mm256_set1_ps
#undef _mm256_set1_pd
#undef _mm256_set1_epi32
#define _mm256_set1_ps(a) simde_mm256_set1_ps(web_float(a))
#define _mm256_set1_pd(a) simde_mm256_set1_pd(web_double(a))
#define _mm256_set1_epi32(a) simde_mm256_set1_epi32(web_int(a))

// SIMDe rounds to nearest lane by lane.
static inline __m256 web_nearest(__m256 a) {
    union {
        __m256 whole;
        v128_t half[2];
    } x = {a};
    x.half[0] = wasm_f32x4_nearest(x.half[0]);
    x.half[1] = wasm_f32x4_nearest(x.half[1]);
    return x.whole;
}
#undef _mm256_round_ps
#define _mm256_round_ps(a, to_nearest) web_nearest(a)
