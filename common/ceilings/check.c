#include "check.h"

#include <stdio.h>

#include "expected.h"

// A register of each form that the body reads at so many loops.
static int register_read(enum form form, long loops) {
    return form == CHAINS ? (int)loops % 14 : form == APART ? 10 + (int)loops % 4 : 12;
}

// Faults of a kernel of arithmetic after so many loops.
static int compute_faults(const struct compute *c, long loops) {
    int wrong = 0;
    char name[64];
    name_of(c, name);
    union registers in, out, wanted;
    start(c, &in);
    expect(c, loops, &in, &wanted);
    c->run(loops, &in, &out);
    wrong += !work_done(c, &out, &wanted, false);
    c->run(loops + 1, &in, &out);
    if (work_done(c, &out, &wanted, true) && ++wrong)
        fprintf(stderr, "ceilings: %s: %ld loops pass for %ld\n", name, loops + 1, loops);
    int at = register_read(form_of(c->kind), loops), odd = lanes_of(c) - 1;
    set_lane(&in, c->is_double, at, odd, lane(&in, c->is_double, at, odd) + 0.5);
    c->run(loops, &in, &out);
    if (work_done(c, &out, &wanted, true) && ++wrong)
        fprintf(stderr, "ceilings: %s: another start of register %d passes\n", name, at);
    return wrong;
}

static int moving_faults(const struct moving *m, long blocks) {
    int wrong = !moves_rightly(m, blocks, blocks, false);
    if (moves_rightly(m, blocks + 1, blocks, true) && ++wrong)
        fprintf(stderr, "ceilings: %s %d bits: %ld blocks pass for %ld\n", MOTION_NAMES[m->motion],
                m->bits, blocks + 1, blocks);
    return wrong;
}

enum status check(void) {
    static const long loops[] = {1, 2, 7, 300}, blocks[] = {1, 3, 130};
    int kernels = 0, wrong = 0;
    for (int k = 0; k < COMPUTES; k++)
        if (has(COMPUTE[k].needs)) {
            kernels++;
            for (int i = 0; i < 4; i++)
                wrong += compute_faults(&COMPUTE[k], loops[i]);
        }
    for (int k = 0; k < KINDS_OF_MOVING; k++)
        if (has(MOVINGS[k].needs)) {
            kernels++;
            for (int i = 0; i < 3; i++)
                wrong += moving_faults(&MOVINGS[k], blocks[i]);
        }
    printf("%d kernels checked, %d wrong\n", kernels, wrong);
    return wrong ? WRONG_WORK : OK;
}
