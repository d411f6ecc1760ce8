// flags: -iquote phases/opt9_convex -DLANES=8 -mavx2 -mfma -ffp-contract=off
#include "bulb_lanes.h"
