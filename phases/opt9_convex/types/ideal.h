// How shadows "ideal" are drawn: whole frames are marched (fallback/march.c).
#pragma once

enum { SOFT_IS_IDEAL = 0 }; // 1: the phase's soft shadows are the ideal ones already
