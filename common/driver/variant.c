// What the build fixed, and which variant runs on this CPU.
#include "driver/variant.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "phase_info.h"
#include "timing/timer.h"

static const char *const planes[] = {PHASE_PLANES NULL};

const struct phase_built phase_built = {PHASE_NAME,     PHASE_FLAGS_FROM, PHASE_PRECISION,
                                        PHASE_COMPILER, planes,           PHASE_GROUPS,
                                        PHASE_THREADS,  PHASE_DISPLAY};

#ifdef __x86_64__
#define ASK_CPU() __builtin_cpu_init()
#define CPU_HAS(feature) __builtin_cpu_supports(feature)
#else // NEON is part of every aarch64
#define ASK_CPU() ((void)0)
#define CPU_HAS(feature) false
#endif

// True if the CPU lacks the feature or STEPWISE_ISA_LIMIT hides it. `supported` is the answer of
// __builtin_cpu_supports, which takes only literals and so cannot be called here.
static bool lacks(const char *feature, bool supported) {
    const char *limit = getenv("STEPWISE_ISA_LIMIT");
    if (limit && strcmp(limit, "none") == 0)
        return true;
    if (limit && strcmp(limit, "avx2") == 0 && strncmp(feature, "avx512", 6) == 0)
        return true;
    return !supported;
}

#define LACKS(feature) lacks(feature, CPU_HAS(feature))

bool variant_limit_valid(void) {
    const char *limit = getenv("STEPWISE_ISA_LIMIT");
    return !limit || !*limit || strcmp(limit, "avx2") == 0 || strcmp(limit, "none") == 0;
}

const char *variant_missing(void) {
    ASK_CPU();
#define NEED(feature)                                                                              \
    if (LACKS(feature))                                                                            \
        return feature;
    PHASE_NEEDS(NEED)
#undef NEED
    (void)lacks; // unused if the phase needs nothing
    return timer_missing();
}

struct variant variant_here(void) {
    ASK_CPU();
// An emulated feature does not depend on the CPU, only on STEPWISE_ISA_LIMIT.
#define EMULATED(feature) (PHASE_EMULATED && strncmp(feature, "avx512", 6) == 0)
#define ALSO_NEED(feature) &&!lacks(feature, EMULATED(feature) || CPU_HAS(feature))
#define VARIANT(lanes, isa, flags, needs)                                                          \
    if (true needs)                                                                                \
        return (struct variant){lanes, isa, flags};
    PHASE_VARIANTS(VARIANT, ALSO_NEED)
#undef VARIANT
#undef ALSO_NEED
    return (struct variant){PHASE_LANES, PHASE_ISA, PHASE_FLAGS};
}
