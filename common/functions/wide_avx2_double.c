// Kernels of 256 bits in double.
#define BITS 256
#define DOUBLE 1
#include "wide.h"
