// flags: -iquote phases/opt9_convex -DLANES=16 -mavx2 -mfma -mavx512f -mavx512dq -ffp-contract=off
#include "bulb_lanes.h"
