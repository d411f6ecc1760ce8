// Three clocks: wall time by clock_gettime, in nanoseconds; timer cycles, of a constant rate, by fenced reads;
// core cycles, estimated from a chain of dependent register adds. The timer is the TSC of x86-64 (Intel SDM
// vol. 2 on RDTSC and RDTSCP; G. Paoloni, "How to Benchmark Code Execution Times on Intel IA-32 and IA-64
// Instruction Set Architectures", Intel, 2010) and the generic timer of arm64, which ticks at 24 MHz to 1 GHz
// (Arm Architecture Reference Manual, DDI 0487, chapter D12).
#pragma once

#include <stdbool.h>
#include <stdint.h>

#ifdef __x86_64__
// Returns the TSC at the start of a timed region. The lfence before it waits for all earlier
// instructions; the lfence after it keeps later ones from starting early.
static inline uint64_t timer_tsc_begin(void) {
    uint32_t lo, hi;
    __asm__ volatile("lfence\n\trdtsc\n\tlfence" : "=a"(lo), "=d"(hi)::"memory");
    return ((uint64_t)hi << 32) | lo;
}

// Returns the TSC at the end of a timed region. rdtscp waits for all earlier instructions.
static inline uint64_t timer_tsc_end(void) {
    uint32_t lo, hi, aux;
    __asm__ volatile("rdtscp\n\tlfence" : "=a"(lo), "=d"(hi), "=c"(aux)::"memory");
    return ((uint64_t)hi << 32) | lo;
}
#elif defined __aarch64__
// Returns the generic timer, CNTVCT_EL0. isb waits for all earlier instructions and keeps later ones from
// starting early.
static inline uint64_t timer_tsc_begin(void) {
    uint64_t count;
    __asm__ volatile("isb\n\tmrs %0, cntvct_el0\n\tisb" : "=r"(count)::"memory");
    return count;
}

static inline uint64_t timer_tsc_end(void) {
    return timer_tsc_begin();
}
#else
#error "timer.h knows the clocks of x86-64 and of aarch64"
#endif

// Returns the instruction that timer_tsc_end needs and this CPU lacks (rdtscp, which a hypervisor may hide), or
// NULL. A program that measures asks first.
const char *timer_missing(void);

// Returns wall time in nanoseconds (CLOCK_MONOTONIC_RAW).
uint64_t timer_ns(void);

// Returns timer cycles per second: on x86-64 measured against CLOCK_MONOTONIC_RAW for about `milliseconds`,
// on arm64 what the register CNTFRQ_EL0 says.
double timer_tsc_hz(int milliseconds);

// Returns the timer's own overhead in its cycles: the smallest difference of an empty begin/end pair. 0 where a
// cycle is longer than that.
uint64_t timer_overhead_cycles(void);

// Returns core cycles per second. Each add of a dependent chain takes one core cycle. The adds have
// register operands, because Golden Cove executes adds of small constants at rename, in no cycle.
// The fastest of `samples` chains counts, as interrupts only add time; a chain takes at most 0.25 ms.
double timer_core_hz(double tsc_hz, int samples);

// Returns core cycles per second while FMAs keep the vector units busy, after about 2 ms of that
// load: wide vectors can lower the clock. `bits`: 128, 256 or 512. Returns 0 if the CPU lacks them.
double timer_core_hz_under_load(double tsc_hz, int samples, int bits);
