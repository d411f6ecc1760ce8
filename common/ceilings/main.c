// Measures ceilings of this machine: the best rates of one core, per cycle and per second. Prints one
// JSON object (results/README.md). Exit status: 0 done; 1 a kernel did not do its work; 2 bad arguments;
// 3 this CPU lacks what times; 5 out of memory.
//
//   ceilings [--samples N]
//
// Arithmetic (arithmetic.h): throughput of fma, add, mul, minmax, div, sqrt and rsqrt, in double and
// single precision, from scalar to the widest registers. Also mixes of adds and multiplications: add+mul in
// turn, add+2mul 5 to 9, 2add+mul 9 to 5. Some cores have separate units for both, so that a mix
// issues more per cycle; which mix is fastest depends on the core. Bandwidth (bandwidth.h): load,
// store and copy in L1, L2, L3 and memory (working_sets.h). The estimate is described in samples.h.
//
// Kernels are assembly, so that no compiler folds, hoists or removes them. All are checked.
//
// Sources: A. Fog, "Instruction tables" (agner.org/optimize), on chains and units. A. Abel and J.
// Reineke, "uops.info", ASPLOS 2019, on measuring throughput. J. D. McCalpin's STREAM, on bandwidth;
// bytes are counted as the core sees them, without write-allocate, for the cache-aware roofline (A.
// Ilic, F. Pratas, L. Sousa, IEEE Computer Architecture Letters 13(1), 2014). Intel SDM vol. 2, on
// the errors of rsqrt.
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "measure.h"
#include "timing/timer.h"

int main(int argc, char **argv) {
    uint64_t begin = timer_ns();
    long samples = 30;
    char *end = "";
    bool asked = argc == 3 && strcmp(argv[1], "--samples") == 0;
    if (asked)
        samples = strtol(argv[2], &end, 10);
    if (argc != 1 + 2 * asked || *end || samples < 5 || samples > MAX_SAMPLES) {
        fprintf(stderr, "usage: ceilings [--samples N], 5 to %d of each ceiling (30)\n",
                MAX_SAMPLES);
        return BAD_INPUT;
    }
    if (timer_missing()) {
        fprintf(stderr, "ceilings: the CPU lacks %s\n", timer_missing());
        return NO_TIMER;
    }
    struct ceilings *all = calloc(1, sizeof *all);
    if (!all) {
        fprintf(stderr, "ceilings: out of memory: %zu MiB are needed\n", sizeof *all >> 20);
        return OUT_OF_MEMORY;
    }
    enum status status = ceilings_prepare(all);
    if (status == OK)
        status = ceilings_measure(all, (int)samples);
    if (status == OK) {
        report_json(all, begin);
        if (fflush(stdout) != 0 || ferror(stdout)) {
            fprintf(stderr, "ceilings: standard output cannot be written: %s\n", strerror(errno));
            status = BAD_INPUT;
        }
    }
    free(all->memory);
    free(all);
    return (int)status;
}
