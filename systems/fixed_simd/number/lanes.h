// The lanes of the build at hand: tile.c is built for 8 and for 16 (phase.json). number.h says what each operation is.
#ifndef FIXED_LANES_H
#define FIXED_LANES_H

#include <stdbool.h>
#include <stdint.h>

#if LANES == 16
#include "number/lanes16.h"
#elif LANES == 8
#include "number/lanes8.h"
#else
#error "LANES: 8 or 16; common/rules.mk sets it for the files of each_variant in phase.json"
#endif

#endif
