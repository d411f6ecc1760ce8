// The clocks against each other. None of these is a test of speed: each compares two ways of
// measuring the same thing, by the best of many tries, since what a noisy machine does only ever
// adds time.
#include "tests/c/testing.h"

#include <math.h>
#include <sched.h>
#include <stdlib.h>
#include <time.h>

#include "timing/timer.h"

#ifdef __aarch64__
enum { COARSE = 1, CYCLES = 1 }; // its timer may stand still between two readings
#define LINK "eor %0, %0, %1\n\t"
#else
enum { COARSE = 0, CYCLES = 3 };
#define LINK "imul %1, %0\n\t"
#endif

static double tsc_hz;

// One CPU throughout, so that no migration lies between two readings.
static int stay_on_this_cpu(void **state) {
    (void)state;
    cpu_set_t here;
    CPU_ZERO(&here);
    CPU_SET(sched_getcpu(), &here);
    sched_setaffinity(0, sizeof here, &here);
    tsc_hz = timer_tsc_hz(20);
    return 0;
}

TEST(clocks_never_run_backwards) {
    uint64_t tsc = timer_tsc_begin(), ns = timer_ns();
    for (int i = 0; i < 100000; i++) {
        uint64_t begin = timer_tsc_begin(), end = timer_tsc_end(), now = timer_ns();
        assert_true(begin + COARSE > tsc && end + COARSE > begin && now >= ns);
        tsc = end;
        ns = now;
    }
}

TEST(ns_is_the_raw_monotonic_clock) {
    for (int i = 0; i < 1000; i++) {
        struct timespec now;
        uint64_t before = timer_ns();
        clock_gettime(CLOCK_MONOTONIC_RAW, &now);
        uint64_t middle = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
        assert_true(before <= middle && middle <= timer_ns());
    }
}

// The same stretches of time by timer and by clock_gettime. What lies between the two readings at
// either end (about 50 ns) is the error: 1e-5 of 5 ms. Over 1e-3 in each of 20 tries is a wrong
// rate, no noise.
TEST(timer_agrees_with_clock_gettime) {
    double least = INFINITY;
    for (int i = 0; i < 20; i++) {
        uint64_t ns = timer_ns(), tsc = timer_tsc_begin(), now;
        while ((now = timer_ns()) - ns < 5000000)
            continue;
        double by_tsc = (double)(timer_tsc_end() - tsc) / tsc_hz;
        least = fmin(least, fabs(by_tsc * 1e9 / (double)(now - ns) - 1));
    }
    print_message("timer against clock_gettime over 5 ms: %.1e apart at best\n", least);
    assert_true(least < 1e-3);
}

TEST(overhead_is_positive) {
    uint64_t overhead = timer_overhead_cycles();
    print_message("an empty pair takes %d timer cycles\n", (int)overhead);
    assert_in_range(overhead, 1 - COARSE,
                    100000); // a hypervisor that traps RDTSC needs some thousands
    uint64_t least = UINT64_MAX;
    for (int i = 0; i < 1000; i++) {
        uint64_t begin = timer_tsc_begin(), pair = timer_tsc_end() - begin;
        least = pair < least ? pair : least;
    }
    assert_in_range(least, overhead / 4, overhead * 4 + COARSE);
}

enum { LINKS = 40000 };

static uint64_t dependent(void) {
    uint64_t x = 3, factor = 5, begin = timer_tsc_begin();
    for (int i = 0; i < LINKS / 8; i++)
        __asm__ volatile(LINK LINK LINK LINK LINK LINK LINK LINK : "+r"(x) : "r"(factor) : "cc");
    return timer_tsc_end() - begin;
}

// A dependent 64-bit multiplication takes 3 cycles on every Intel core since Nehalem and every AMD
// core since Zen, an exclusive or 1 on every core: so many must the clock of the chain of adds make of it.
// Fastest of each, taken in turn, until they agree; 5 % for a clock that moves meanwhile.
TEST(core_clock_counts_cycles) {
    if (getenv("STEPWISE_EMULATED")) // of an emulator no instruction has a cycle
        skip();
    double fastest_hz = 0, least_seconds = INFINITY, cycles = 0;
    for (int i = 0; i < 2000 && !(fabs(cycles - CYCLES) < 0.01 * CYCLES); i++) {
        fastest_hz = fmax(fastest_hz, timer_core_hz(tsc_hz, 2));
        least_seconds = fmin(least_seconds, (double)dependent() / tsc_hz);
        cycles = least_seconds * fastest_hz / LINKS;
    }
    print_message("a dependent instruction of %d cycles takes %.3f core cycles\n", CYCLES, cycles);
    assert_true(fabs(cycles - CYCLES) < 0.05 * CYCLES);
}

TEST(core_clock_under_load) {
    if (getenv("STEPWISE_EMULATED"))
        skip();
    double idle = timer_core_hz(tsc_hz, 50);
    assert_true(idle > 2e8 && idle < 1e10);
#ifdef __aarch64__
    const bool has[] = {false, true, false, false};
#else
    __builtin_cpu_init();
    bool fma = __builtin_cpu_supports("fma"), avx2 = __builtin_cpu_supports("avx2");
    const bool has[] = {false, fma, fma && avx2, __builtin_cpu_supports("avx512f")};
#endif
    for (int i = 0, bits = 0; i < 4; i++, bits = 64 << i) {
        double loaded = timer_core_hz_under_load(tsc_hz, 50, bits);
        print_message("core clock under %d-bit FMAs: %.2f GHz\n", bits, loaded / 1e9);
        assert_int_equal(loaded > 0, has[i]);
        // The vector units stay beside the chain: a clock of half the idle one would be their
        // latency.
        if (has[i])
            assert_true(loaded > 0.5 * idle && loaded < 1.5 * idle);
    }
}

RUN_TESTS(stay_on_this_cpu, NULL)
