// flags: -DLANES=4 -ffp-contract=off
#define NEEDED true
#include "simd_lanes.h"
