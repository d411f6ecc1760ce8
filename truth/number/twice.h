// Includes the file that BODY names twice: in doubles and in quads. REAL is a number, IV an interval, FN(name) a name of
// that kind, U the unit roundoff. No `#pragma once`: each use includes it again.
#define REAL double
#define IV ivd
#define FN(name) name##_d
#define U 0x1p-53
#include BODY
#undef REAL
#undef IV
#undef FN
#undef U

#define REAL quad
#define IV ivq
#define FN(name) name##_q
#define U ((quad)0x1p-113)
#include BODY
#undef REAL
#undef IV
#undef FN
#undef U
#undef BODY
