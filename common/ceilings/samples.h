// Samples of a ceiling, and what they say.
//
// The estimate is the best that was seen three times (within 1 %). A ceiling is what the core could
// do undisturbed, and whatever disturbs (an interrupt, a neighbour on the other hyper-thread, a
// stolen time slice) makes a sample slower, so the best of many short ones, spread over the
// program's run time, comes nearest. But it may as well disturb the measuring of the clock, and
// then a figure per cycle comes out too high: such ones scatter, a ceiling repeats itself. Beside
// it stand the median, its 95 % interval and the worst: what was usual.
#ifndef STEPWISE_CEILINGS_SAMPLES_H
#define STEPWISE_CEILINGS_SAMPLES_H

#include <stdbool.h>
#include <stdint.h>

enum { MOST_SAMPLES = 1000, REPEATED = 3 };

struct clocks {
    double tsc_hz;
    uint64_t overhead;
};

struct samples {
    double per_cycle[MOST_SAMPLES], per_second[MOST_SAMPLES], hz[MOST_SAMPLES];
    int count;
};

double seconds_of(const struct clocks *clocks, uint64_t ticks);

// One round: `one` is timed until `count` samples are good, each with a chain of adds (33 us at 3
// GHz) before and after it. Dense 512-bit FMAs lower some clocks by more than the one FMA per cycle
// of timer_core_hz_under_load does, and a clock takes longer to come back than the chain lasts: so
// it is the chains right beside the sample that count. Where they differ, the clock moved or one of
// them was disturbed (a busy hyper-thread slows it by 10 to 20 %, never twice alike): what a cycle
// was is not known, no sample.
//
// `warm`: what is timed runs once untimed before. After the scalar chain the first microseconds of
// 512-bit code are slow, while the core brings its upper halves up: without this the ceilings of
// FMA, add and mul at 512 bits came out 2 to 5 % low. From memory it would only be in the way.
void sample(struct samples *s, const struct clocks *clocks, void (*one)(void *), void *what,
            bool warm, double work, int count);

struct summary {
    double best, median, low, high, worst, per_second, hz;
};

// Of REPEATED samples or more. Puts them in order.
struct summary summarize(struct samples *s);

#endif
