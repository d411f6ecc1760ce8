// Clocks and their calibration. See timer.h.
#include "timing/timer.h"

#ifdef __x86_64__
#include <cpuid.h>
#include <immintrin.h>
#else
#include <arm_neon.h>
#endif
#include <stddef.h>
#include <time.h>

uint64_t timer_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC_RAW, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

const char *timer_missing(void) {
#ifdef __x86_64__
    unsigned eax, ebx, ecx, edx;
    if (!__get_cpuid(0x80000001, &eax, &ebx, &ecx, &edx) || !(edx >> 27 & 1))
        return "rdtscp";
#endif
    return NULL;
}

#ifdef __x86_64__
// Reads both clocks together. Of ten tries the fastest counts, as its two readings are closest in time.
static void read_pair(uint64_t *ns, uint64_t *tsc) {
    uint64_t narrowest = UINT64_MAX;
    for (int i = 0; i < 10; i++) {
        uint64_t a = timer_tsc_begin();
        uint64_t now = timer_ns();
        uint64_t b = timer_tsc_end();
        if (b - a < narrowest) {
            narrowest = b - a;
            *ns = now;
            *tsc = a + (b - a) / 2;
        }
    }
}

double timer_tsc_hz(int milliseconds) {
    uint64_t ns0 = 0, tsc0 = 0, ns1 = 0, tsc1 = 0;
    read_pair(&ns0, &tsc0);
    while (timer_ns() - ns0 < (uint64_t)milliseconds * 1000000u)
        continue;
    read_pair(&ns1, &tsc1);
    return (double)(tsc1 - tsc0) * 1e9 / (double)(ns1 - ns0);
}
#else
double timer_tsc_hz(int milliseconds) {
    uint64_t hz;
    (void)milliseconds;
    __asm__("mrs %0, cntfrq_el0" : "=r"(hz));
    return (double)hz;
}
#endif

uint64_t timer_overhead_cycles(void) {
    uint64_t least = UINT64_MAX;
    for (int i = 0; i < 1000; i++) {
        uint64_t begin = timer_tsc_begin();
        uint64_t end = timer_tsc_end();
        if (end - begin < least)
            least = end - begin;
    }
    return least;
}

// CHAIN: adds of a chain. 25 µs at 4 GHz, 100 µs at 1 GHz; on arm64 2.5 times that, so that a cycle of a timer of
// 24 MHz is less than 0.1 % of it.
#ifdef __x86_64__
enum { CHAIN = 100000 };
#define ADD "add %1, %0\n\t"
#define ADD_FMA(K) "add %9, %8\n\tvfmadd231ps %" #K ", %" #K ", %" #K "\n\t"
#else
enum { CHAIN = 250000 };
#define ADD "add %0, %0, %1\n\t"
#define ADD_FMA(K) "add %8, %8, %9\n\tfmla %" #K ".4s, %" #K ".4s, %" #K ".4s\n\t"
#endif
#define ADD8 ADD ADD ADD ADD ADD ADD ADD ADD

// Timer cycles of CHAIN dependent adds.
static uint64_t chain(void) {
    uint64_t x = 1, one = 1;
    uint64_t begin = timer_tsc_begin();
    for (int i = 0; i < CHAIN / 40; i++)
        __asm__ volatile(ADD8 ADD8 ADD8 ADD8 ADD8 : "+r"(x) : "r"(one) : "cc");
    return timer_tsc_end() - begin;
}

// The same chain with one FMA next to each add, which keeps the vector unit busy. Eight accumulators in turn
// are more than the FMAs' latency of 4 or 5 cycles, so the adds stay the critical path.
#define LOADED_CHAIN(NAME, TARGET, TYPE, IN_OUT)                                                   \
    TARGET static uint64_t NAME(int links) {                                                       \
        uint64_t x = 1, one = 1;                                                                   \
        TYPE a = {0}, b = a, c = a, d = a, e = a, f = a, g = a, h = a;                             \
        uint64_t begin = timer_tsc_begin();                                                        \
        for (int i = 0; i < links / 8; i++)                                                        \
            __asm__ volatile(ADD_FMA(0) ADD_FMA(1) ADD_FMA(2) ADD_FMA(3) ADD_FMA(4) ADD_FMA(5)     \
                                 ADD_FMA(6) ADD_FMA(7)                                             \
                             : IN_OUT(a), IN_OUT(b), IN_OUT(c), IN_OUT(d), IN_OUT(e), IN_OUT(f),   \
                               IN_OUT(g), IN_OUT(h), "+r"(x)                                       \
                             : "r"(one)                                                            \
                             : "cc");                                                              \
        return timer_tsc_end() - begin;                                                            \
    }

#ifdef __x86_64__
LOADED_CHAIN(chain_128, __attribute__((target("fma"))), __m128, "+x")
LOADED_CHAIN(chain_256, __attribute__((target("avx2,fma"))), __m256, "+x")
LOADED_CHAIN(chain_512, __attribute__((target("avx512f"))), __m512, "+v")
#else
LOADED_CHAIN(chain_128, , float32x4_t, "+w")
#endif

// Core clock in Hz from the fastest of `samples` chains; `loaded` NULL: adds alone.
static double fastest(uint64_t (*loaded)(int), double tsc_hz, int samples) {
    uint64_t least = UINT64_MAX;
    for (int i = 0; i < samples; i++) {
        uint64_t cycles = loaded ? loaded(CHAIN) : chain();
        if (cycles < least)
            least = cycles;
    }
    return CHAIN * tsc_hz / (double)least;
}

double timer_core_hz(double tsc_hz, int samples) {
    return fastest(0, tsc_hz, samples);
}

double timer_core_hz_under_load(double tsc_hz, int samples, int bits) {
    uint64_t (*loaded)(int) = 0;
#ifdef __x86_64__
    __builtin_cpu_init();
    if (bits == 128 && __builtin_cpu_supports("fma"))
        loaded = chain_128;
    else if (bits == 256 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        loaded = chain_256;
    else if (bits == 512 && __builtin_cpu_supports("avx512f"))
        loaded = chain_512;
#else
    if (bits == 128)
        loaded = chain_128;
#endif
    if (!loaded)
        return 0;
    loaded(8000000); // about 2 ms, until the clock has settled
    return fastest(loaded, tsc_hz, samples);
}
