// Ceilings of this machine: what one core can do at best per cycle and per second.
//
//   ceilings [--json] [--check] [--samples N]
//
// Arithmetic (arithmetic.c): throughput of fma, add, mul, minmax, div, sqrt and rsqrt, scalar to 512
// bits, double and single, and of adds and multiplications mixed (add+mul: in turn; add+2mul: 5 to 9;
// 2add+mul: 9 to 5): some cores have units for each and some for both, so that a mix issues more per
// cycle than either, and which mix does most depends on the core. Bandwidth (bandwidth.c): load, store
// and copy, out of L1, L2, L3 and memory (places.c). The estimate: samples.h.
//
// Kernels are assembly, so that no compiler folds, hoists or drops them, and each says what it must
// have done: after its samples the registers are held against the same arithmetic done one by one
// in C, and what loads, stores and copies move is looked at byte by byte before they are timed.
//
// Methods: A. Fog, "Instruction tables" (agner.org/optimize), on chains and units; A. Abel, J.
// Reineke, "uops.info", ASPLOS 2019, on measuring throughput; J. D. McCalpin's STREAM for
// bandwidth, with bytes counted here as the core sees them (no write-allocate), as the cache-aware
// roofline wants them: A. Ilic, F. Pratas, L. Sousa, IEEE Computer Architecture Letters 13(1),
// 2014. Errors of rsqrt: Intel SDM vol. 2.
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"
#include "measure.h"
#include "report.h"
#include "timing/timer.h"

struct options {
    bool json, check;
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

// OK, or the status to exit with (−1: --help was served).
static int parse(int argc, char **argv, struct options *o) {
    *o = (struct options){.samples = 30};
    for (int i = 1; i < argc; i++) {
        char *end = NULL;
        if (strcmp(argv[i], "--json") == 0)
            o->json = true;
        else if (strcmp(argv[i], "--check") == 0)
            o->check = true;
        else if (strcmp(argv[i], "-h") == 0 || strcmp(argv[i], "--help") == 0)
            return usage(stdout, -1);
        else if (strcmp(argv[i], "--samples") == 0 && i + 1 < argc) {
            long value = strtol(argv[++i], &end, 10);
            if (*end || end == argv[i] || value < 5 || value > MOST_SAMPLES) {
                fprintf(stderr, "ceilings: --samples: 5 to %d is required, not \"%s\"\n",
                        MOST_SAMPLES, argv[i]);
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
    return o.check ? (int)check() : (int)measure(&o);
}
