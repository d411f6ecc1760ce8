// flags: -iquote phases/opt7_tiles -iquote phases/opt6_wide -DLANES=8 -mavx2 -mfma -ffp-contract=off
#include "group_programs.h"
