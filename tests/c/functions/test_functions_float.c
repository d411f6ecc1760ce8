// flags: -mavx2 -mfma -ffp-contract=off
#include "phases/opt4/vec.h"

#define DOUBLE 0
#include "same_bits.h"
