// libm and the like in double, one element at a time.
#define DOUBLE 1
#include "scalar.h"
