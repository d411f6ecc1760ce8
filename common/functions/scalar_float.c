// libm and the like in float, one element at a time.
#define DOUBLE 0
#include "scalar.h"
