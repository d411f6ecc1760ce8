// flags: -mavx2 -mfma -ffp-contract=off
#include "phases/opt3/vec.h"

#define DOUBLE 1
#include "same_bits.h"
