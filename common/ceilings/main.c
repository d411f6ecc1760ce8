// Measures ceilings of this machine: the best rates of one core, per cycle and per second.
//
//   ceilings [--json] [--check] [--samples N]
//
// Arithmetic (arithmetic.c): throughput of fma, add, mul, minmax, div, sqrt and rsqrt, in double and
// single precision, from scalar to 512 bits. Also mixes of adds and multiplications: add+mul in
// turn, add+2mul 5 to 9, 2add+mul 9 to 5. Some cores have separate units for both, so that a mix
// issues more per cycle; which mix is fastest depends on the core. Bandwidth (bandwidth.c): load,
// store and copy in L1, L2, L3 and memory (working_sets.h). The estimate is described in samples.h.
//
// Kernels are assembly, so that no compiler folds, hoists or removes them. All are checked: after its
// samples, an arithmetic kernel's registers are compared with the same arithmetic in C. The bytes
// that loads, stores and copies transfer are compared before they are timed.
//
// Sources: A. Fog, "Instruction tables" (agner.org/optimize), on chains and units. A. Abel and J.
// Reineke, "uops.info", ASPLOS 2019, on measuring throughput. J. D. McCalpin's STREAM, on bandwidth;
// bytes are counted as the core sees them, without write-allocate, for the cache-aware roofline (A.
// Ilic, F. Pratas, L. Sousa, IEEE Computer Architecture Letters 13(1), 2014). Intel SDM vol. 2, on
// the errors of rsqrt.
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "measure.h"
#include "report.h"
#include "self_test.h"
#include "timing/timer.h"

struct options {
    bool json, self_test;
    int samples;
};

static int usage(FILE *file, int status) {
    fputs(
        "usage: ceilings [--json] [--check] [--samples N]\n"
        "  Ceilings of one core: arithmetic and bandwidth, per core cycle and per second.\n"
        "  --json       one JSON object on standard output\n"
        "  --check      whether every kernel does its work, and a wrong one is noticed; no timing\n"
        "  --samples N  of each ceiling, 5 to 1000 (30), in 5 rounds\n"
        "exit status: 0 done; 1 a kernel did not do its work; 2 bad arguments; 5 out of memory\n",
        file);
    return status;
}

// Returns OK, an error's exit status, or −1 if the argument was --help and is answered.
static int parse(int argc, char **argv, struct options *o) {
    *o = (struct options){.samples = 30};
    for (int i = 1; i < argc; i++) {
        char *end = NULL;
        if (strcmp(argv[i], "--json") == 0)
            o->json = true;
        else if (strcmp(argv[i], "--check") == 0)
            o->self_test = true;
        else if (strcmp(argv[i], "-h") == 0 || strcmp(argv[i], "--help") == 0)
            return usage(stdout, -1);
        else if (strcmp(argv[i], "--samples") == 0 && i + 1 < argc) {
            long value = strtol(argv[++i], &end, 10);
            if (*end || end == argv[i] || value < 5 || value > MAX_SAMPLES) {
                fprintf(stderr, "ceilings: --samples: 5 to %d is required, not \"%s\"\n",
                        MAX_SAMPLES, argv[i]);
                return BAD_INPUT;
            }
            o->samples = (int)value;
        } else {
            fprintf(stderr, "ceilings: %s: unknown option, or its value is missing\n", argv[i]);
            return usage(stderr, BAD_INPUT);
        }
    }
    return OK;
}

static enum status measure(const struct options *o) {
    uint64_t begin = timer_ns();
    struct ceilings *all = calloc(1, sizeof *all);
    if (!all) {
        fprintf(stderr, "ceilings: out of memory: %zu MiB are needed\n", sizeof *all >> 20);
        return OUT_OF_MEMORY;
    }
    enum status status = ceilings_prepare(all);
    if (status == OK)
        status = ceilings_measure(all, o->samples);
    if (status == OK) {
        if (o->json)
            report_json(all, begin);
        else
            report_table(all, o->samples);
        if (fflush(stdout) != 0 || ferror(stdout)) {
            fprintf(stderr, "ceilings: standard output cannot be written: %s\n", strerror(errno));
            status = BAD_INPUT;
        }
    }
    free(all->memory);
    free(all);
    return status;
}

int main(int argc, char **argv) {
    struct options o;
    int status = parse(argc, argv, &o);
    if (status != OK)
        return status < 0 ? OK : status;
    return o.self_test ? (int)self_test() : (int)measure(&o);
}
