// What the phase does unless STEPWISE_FIXED tells it otherwise.
#ifndef FIXED_OWN_H
#define FIXED_OWN_H

#define OWN_CLEAR CLEAR_LISTS

#endif
