// SSE to AVX2 and FMA on other machines, by SIMDe (https://github.com/simd-everywhere/simde, package libsimde-dev): for
// what is written in x86's intrinsics, the paper's opt3 and opt4 above all. common/simd has NEON words of its own.
#pragma once

#if !__has_include(<simde/x86/avx2.h>)
#error "x86's intrinsics are built for this machine by SIMDe: apt-get install libsimde-dev"
#endif
#define SIMDE_ENABLE_NATIVE_ALIASES
#include <simde/x86/avx2.h>
#include <simde/x86/fma.h>

// SIMDe 0.7.4 has these under its own names alone.
#ifndef _MM_FROUND_NO_EXC
#define _MM_FROUND_NO_EXC SIMDE_MM_FROUND_NO_EXC
#endif
#ifndef _MM_FROUND_TO_NEAREST_INT
#define _MM_FROUND_TO_NEAREST_INT SIMDE_MM_FROUND_TO_NEAREST_INT
#endif
#ifndef _CMP_EQ_OQ
#define _CMP_EQ_OQ SIMDE_CMP_EQ_OQ
#endif
