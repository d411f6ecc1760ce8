// Kernels of 512 bits in float.
#define BITS 512
#define DOUBLE 0
#include "wide.h"
