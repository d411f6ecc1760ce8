// Kernels of 128 bits in double.
#define BITS 128
#define DOUBLE 1
#include "wide.h"
