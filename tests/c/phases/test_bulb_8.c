// flags: -iquote phases/opt9_convex -iquote phases/opt6_wide -DLANES=8 -mavx2 -mfma -ffp-contract=off
#include "bulb_lanes.h"
