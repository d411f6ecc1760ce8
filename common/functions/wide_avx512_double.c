// Kernels of 512 bits in double.
#define BITS 512
#define DOUBLE 1
#include "wide.h"
