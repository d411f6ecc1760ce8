// Samples of a ceiling, and the estimate from them.
//
// The estimate is the best rate that was seen three times, within 1 %. A ceiling is the rate of an
// undisturbed core. Interrupts, a neighbour on the other hyper-thread and stolen time slices only
// slow a sample down, so the best of many short samples comes nearest. They can also disturb the
// measurement of the clock; the rate per cycle then comes out too high. Such rates scatter, while a
// ceiling repeats. The median, its 95 % interval and the worst sample show what was usual.
#pragma once

#include <stdbool.h>
#include <stdint.h>

enum { MAX_SAMPLES = 1000, REPEATED = 3 };

struct clocks {
    double tsc_hz;
    uint64_t overhead;
};

struct samples {
    double per_cycle[MAX_SAMPLES], per_second[MAX_SAMPLES], hz[MAX_SAMPLES];
    int count;
};

// Seconds of a difference of timer readings, less the timer's overhead.
double ticks_to_seconds(const struct clocks *clocks, uint64_t ticks);

// Times one(what), which does `work` units of work, until `count` samples are good or eight times as
// many have been tried. `warm`: runs it once untimed before each sample. 512-bit code needs this:
// the core powers up the upper halves first, which would make FMA, add and mul 2 to 5 % too slow.
//
// A chain of adds before and after each sample measures the core clock. Dense 512-bit FMAs lower
// some clocks more than timer_core_hz_under_load does, and the clock recovers more slowly than a
// chain takes (33 µs at 3 GHz; timer.c). So the chains next to the sample give its clock. If they differ by
// 0.3 % or more, the clock changed or a chain was disturbed, and the sample is dropped.
void take_samples(struct samples *s, const struct clocks *clocks, void (*one)(void *), void *what,
                  bool warm, double work, int count);

struct summary {
    double best, median, low, high, worst, per_second, hz;
};

// Returns the statistics of at least REPEATED samples. Sorts the samples.
struct summary summarize(struct samples *s);
