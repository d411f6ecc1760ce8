// How shadows "ideal" are drawn: as "soft" ones, which are the ideal ones here.
#ifndef OPT9_IDEAL_H
#define OPT9_IDEAL_H

enum { SOFT_IS_IDEAL = 1 };

#endif
