// Presenting a frame leaves the upper halves of vector registers as a program of SSE alone has them. Sanitizers change
// what a compiler puts there: tests/study/core/test_build.py runs this program as the renderers are built, too.
#include "tests/c/testing.h"

#include <cpuid.h>
#include <immintrin.h>
#include <stdio.h>
#include <stdlib.h>

#include "frame/frame.h"

// XINUSE (Intel's manual, XGETBV with ECX = 1): which registers are not as they begin. Bit 2: upper halves of ymm.
__attribute__((target("xsave"))) static bool upper_halves_in_use(void) {
    return _xgetbv(1) >> 2 & 1;
}

// Whether the CPU tells: by assembly, as a compiler would clear them before the answer.
static bool upper_halves_in_use_once_used(void) {
    uint32_t low;
    __asm__ volatile("vpcmpeqd %%xmm0, %%xmm0, %%xmm0\n\t"
                     "vinsertf128 $1, %%xmm0, %%ymm0, %%ymm0\n\t"
                     "xgetbv\n\t"
                     "vzeroupper"
                     : "=a"(low)
                     : "c"(1)
                     : "edx", "xmm0");
    return low >> 2 & 1;
}

__attribute__((target("avx"))) static void clear_upper_halves(void) {
    _mm256_zeroupper();
}

// Else scalar frames that are timed after a presented one take up to ten times as long (present.c).
TEST(present_leaves_no_upper_half_in_use) {
    unsigned eax = 0, ebx, ecx, edx;
    if (!__builtin_cpu_supports("avx2") || !__get_cpuid_count(0xd, 1, &eax, &ebx, &ecx, &edx) ||
        !(eax & 4)) {
        printf("skipped: the CPU lacks AVX2, or XGETBV with ECX = 1\n");
        skip();
    }
    assert_true(upper_halves_in_use_once_used());
    static const char *const limits[] = {"avx2", NULL};
    struct frame frame;
    assert_true(
        frame_create(&frame, 21, 1, false, NULL)); // 63 samples: a tail behind eights and sixteens
    uint8_t shown[63];
    for (size_t k = 0; k < LENGTH(limits); k++) {
        limits[k] ? setenv("STEPWISE_ISA_LIMIT", limits[k], 1) : unsetenv("STEPWISE_ISA_LIMIT");
        struct presenter *presenter = presenter_create(1);
        assert_non_null(presenter);
        clear_upper_halves();
        frame_present(presenter, &frame, shown);
        assert_false(upper_halves_in_use());
        presenter_free(presenter);
    }
    frame_free(&frame);
}

RUN_TESTS(NULL, NULL)
