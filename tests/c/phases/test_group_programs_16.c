// flags: -iquote phases/opt7_tiles -iquote phases/opt6_wide -DLANES=16 -mavx512f -mavx512dq -mavx2 -mfma -ffp-contract=off
#include "group_programs.h"
