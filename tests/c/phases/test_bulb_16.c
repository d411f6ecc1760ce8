// flags: -iquote phases/opt9_convex -iquote phases/opt6_wide -DLANES=16 -mavx2 -mfma -mavx512f -mavx512dq -ffp-contract=off
#include "bulb_lanes.h"
