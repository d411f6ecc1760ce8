// Which of its variants a phase runs on this CPU. A phase may have some of its files built several times
// for other numbers of lanes and instruction sets (phase.json: variants, each_variant; rules.mk); each of
// them is compiled with LANES and VARIANT(name), and of its symbols the rest of the phase sees only those
// of that form: lanes16_name, say.
#ifndef STEPWISE_VARIANT_H
#define STEPWISE_VARIANT_H

#include <stdbool.h>

struct variant {
    int lanes;
    const char *isa, *flags; // all it needs: avx2+fma, say; the compiler's
};

// The widest that the CPU has; of a phase without variants what its phase.json says.
struct variant variant_here(void);

// The first instruction set that the phase needs and the CPU lacks, NULL where it has all.
// STEPWISE_ISA_LIMIT in the environment makes the CPU a smaller one: "avx2" one without AVX-512, "none"
// one without anything beyond x86-64.
const char *variant_missing(void);
// Whether it is one of these, or not set.
bool variant_limit_known(void);

#endif
