// All ceilings, measured: which kernels this machine has, how long their samples are, and the samples.
#ifndef STEPWISE_CEILINGS_MEASURE_H
#define STEPWISE_CEILINGS_MEASURE_H

#include "arithmetic.h"
#include "bandwidth.h"
#include "places.h"
#include "samples.h"

enum status { OK, WRONG_WORK, BAD_INPUT, OUT_OF_MEMORY = 5 };

struct computing {
    long loops; // of a sample
    union registers in, wanted;
    struct samples samples;
};

struct transfer {
    const struct moving *moving;
    struct window window;
    long loops;
    struct samples samples;
};

struct ceilings {
    struct clocks clocks;
    struct place places[LEVELS];
    struct computing computing[COMPUTES]; // of what the CPU has
    struct transfer transfers[LEVELS]
                             [KINDS_OF_MOVING]; // of what it has, where there is such a place
    char *memory;
    size_t position; // in memory, where the last sample stopped
};

// Clocks, places, memory and how long each kernel's samples are. On failure says why.
enum status ceilings_prepare(struct ceilings *all);

// `samples` of each, in rounds. On failure says which kernel did not do its work.
enum status ceilings_measure(struct ceilings *all, int samples);

#endif
