// Which variant of a phase runs on this CPU. Files of "each_variant" (phase.json) are compiled once per
// variant, with LANES and VARIANT(name), e.g. lanes16_name, defined: the rest of the phase sees only those
// symbols.
#pragma once

#include <stdbool.h>

struct variant {
    int lanes;
    const char *isa, *flags; // instruction sets that it needs, e.g. avx2+fma; compiler flags
};

// What the build fixed of the phase (phase_info.h). Here alone, so that the driver is compiled once for all phases.
struct phase_built {
    const char *phase, *flags_from, *precision, *compiler;
    const char *const *planes; // its own in a picture, NULL after the last
    bool groups, threads, display;
};

extern const struct phase_built phase_built;

// Returns the widest variant that this CPU supports. For a phase without variants: lanes,
// instruction sets and flags of its phase.json.
struct variant variant_here(void);

// Returns the first instruction set that the phase or its timing needs and the CPU lacks, NULL if it lacks none.
// STEPWISE_ISA_LIMIT hides features, for tests: "avx2" hides AVX-512, "none" hides everything beyond x86-64.
const char *variant_missing(void);
// Returns whether STEPWISE_ISA_LIMIT is unset, empty, "avx2" or "none".
bool variant_limit_valid(void);
