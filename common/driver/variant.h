// Which variant of a phase runs on this CPU. A phase can have some of its files compiled several
// times, for different numbers of lanes and instruction sets (phase.json: "variants" and
// "each_variant"; common/rules.mk). Each time LANES and VARIANT(name) are defined. The rest of the
// phase sees only a variant's symbols of the form VARIANT(name), for example lanes16_name.
#pragma once

#include <stdbool.h>

struct variant {
    int lanes;
    const char *isa, *flags; // instruction sets that it needs, e.g. avx2+fma; compiler flags
};

// Returns the widest variant that this CPU supports. For a phase without variants: lanes,
// instruction sets and flags of its phase.json.
struct variant variant_here(void);

// Returns the first instruction set that the phase needs and the CPU lacks, NULL if it lacks none.
// The environment variable STEPWISE_ISA_LIMIT hides features, for tests of smaller CPUs: "avx2"
// hides AVX-512, "none" hides everything beyond x86-64.
const char *variant_missing(void);
// Returns whether STEPWISE_ISA_LIMIT is unset, empty, "avx2" or "none".
bool variant_limit_valid(void);
