// Measures all ceilings: the kernels that this CPU supports, the lengths of their samples, and the
// samples.
#pragma once

#include "arithmetic.h"
#include "bandwidth.h"
#include "samples.h"
#include "working_sets.h"

enum status { OK, WRONG_WORK, BAD_INPUT, NO_TIMER, OUT_OF_MEMORY = 5 };

struct arithmetic_run {
    long loops; // in one sample
    union registers in, wanted;
    struct samples samples;
};

struct transfer_run {
    const struct transfer_kernel *kernel;
    struct window window;
    long loops;
    struct samples samples;
};

struct ceilings {
    struct clocks clocks;
    struct working_set working_sets[LEVELS];
    struct arithmetic_run arithmetic_runs[ARITHMETIC_KERNEL_COUNT]; // of supported kernels
    struct transfer_run
        transfer_runs[LEVELS][TRANSFER_KERNEL_COUNT]; // of supported kernels and measured levels
    char *memory;
    size_t position; // offset in the memory window where the last sample stopped
};

// Measures the clocks, chooses working sets, allocates memory, checks the transfer kernels and
// chooses the samples' lengths. Returns OK, or an error's status after printing it.
enum status ceilings_prepare(struct ceilings *all);

// Takes `samples` samples of each kernel, in rounds. Returns OK, or WRONG_WORK after printing which
// kernel's results are wrong.
enum status ceilings_measure(struct ceilings *all, int samples);

// report.c: prints one JSON object (fields: results/README.md). `begin`: timer_ns at the program's start.
void report_json(struct ceilings *all, uint64_t begin);
