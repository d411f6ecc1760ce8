// flags: -iquote phases/opt11_ideal -iquote phases/opt10_scene -iquote phases/opt9_convex -iquote phases/opt6_wide -DLANES=8 -mavx2 -mfma -ffp-contract=off
#include "widest_cones.h"
