// Floating point of 113 bits, IEEE 754's binary128. On aarch64 that is long double; on x86-64, where long double has 64
// bits, a type of the compilers' own. libgcc does the arithmetic of both, rounded to nearest.
#pragma once

#include <float.h>

#if LDBL_MANT_DIG == 113
typedef long double quad;
#else
typedef __float128 quad;
#endif
