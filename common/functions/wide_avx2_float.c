// Kernels of 256 bits in float.
#define BITS 256
#define DOUBLE 0
#include "wide.h"
