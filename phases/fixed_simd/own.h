// What the phase does unless STEPWISE_FIXED tells it otherwise: three Newton steps in each root, and no block cleared wrongly.
#ifndef FIXED_OWN_H
#define FIXED_OWN_H

#define OWN_STEPS 3
#define OWN_CLEAR CLEAR_LISTS

#endif
