// What the phase does unless STEPWISE_FIXED tells it otherwise: the article's.
#ifndef FIXED_OWN_H
#define FIXED_OWN_H

#define OWN_STEPS 0
#define OWN_CLEAR CLEAR_CORNERS

#endif
