// How shadows "ideal" are drawn: as "soft" ones, which are the ideal ones here.
#pragma once

enum { SOFT_IS_IDEAL = 1 };
