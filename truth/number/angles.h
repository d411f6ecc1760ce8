// Sine and cosine of an angle in degrees as quad intervals.
#pragma once

#include "number/interval.h"

// Encloses sine and cosine of the exact angle. Quarter turns give points.
void sine_cosine_q(double degrees, struct ivq *sine, struct ivq *cosine);
