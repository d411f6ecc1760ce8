// Clocks. Three of them, and every figure says which: wall time (clock_gettime, ns), TSC cycles
// (constant rate, fenced reads) and core cycles (the core's own clock, estimated by a chain of
// dependent register adds).
//
// Fencing: Intel SDM vol. 2 on RDTSC and RDTSCP; G. Paoloni, "How to Benchmark Code Execution Times
// on Intel IA-32 and IA-64 Instruction Set Architectures" (Intel, 2010).
#ifndef STEPWISE_TIMER_H
#define STEPWISE_TIMER_H

#include <stdbool.h>
#include <stdint.h>

// lfence before: no earlier instruction is still executing. lfence after: no later one has begun.
static inline uint64_t timer_tsc_begin(void) {
    uint32_t lo, hi;
    __asm__ volatile("lfence\n\trdtsc\n\tlfence" : "=a"(lo), "=d"(hi)::"memory");
    return ((uint64_t)hi << 32) | lo;
}

static inline uint64_t timer_tsc_end(void) {
    uint32_t lo, hi, aux;
    __asm__ volatile("rdtscp\n\tlfence" : "=a"(lo), "=d"(hi), "=c"(aux)::"memory");
    return ((uint64_t)hi << 32) | lo;
}

uint64_t timer_ns(void); // CLOCK_MONOTONIC_RAW

// TSC ticks per second against CLOCK_MONOTONIC_RAW over about `milliseconds`.
double timer_tsc_hz(int milliseconds);

// Smallest TSC difference of an empty begin/end pair: the timer's own overhead, in TSC cycles.
uint64_t timer_overhead_cycles(void);

// Core cycles per second: a chain of dependent register-register adds takes one core cycle each.
// (Register operands: Golden Cove executes adds of small immediates at rename, without a cycle.)
// The fastest of `samples` chains of at most 0.25 ms counts, since interrupts only ever add time.
double timer_core_hz(double tsc_hz, int samples);

// The same while vector units of `bits` (0, 128, 256 or 512) are busy with FMAs, after about 2 ms
// of that load: wide units can lower the clock. 0 when the CPU lacks them.
double timer_core_hz_under_load(double tsc_hz, int samples, int bits);

#endif
