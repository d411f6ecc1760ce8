// Kernels of 128 bits in float.
#define BITS 128
#define DOUBLE 0
#include "wide.h"
