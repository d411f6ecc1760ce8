// Tests all kernels of common/ceilings. Each must pass its check, and the check must fail after one loop
// too many and from other operands: a check that cannot fail proves nothing.
#include <stdio.h>

#include "measure.h"
#include "reference.h"

// Returns a register whose value the result depends on, a different one for each number of loops.
static int register_to_disturb(enum form form, long loops) {
    return form == CHAINED ? (int)loops % 14 : form == FROM_RISING ? 10 + (int)loops % 4 : 12;
}

// Tests an arithmetic kernel with so many loops; returns the number of faults.
static int arithmetic_faults(const struct arithmetic_kernel *c, long loops) {
    int wrong = 0;
    char name[64];
    kernel_name(c, name);
    union registers in, out, wanted;
    initial_registers(c, &in);
    reference_result(c, loops, &in, &wanted);
    c->run(loops, &in, &out);
    wrong += !matches_reference(c, &out, &wanted, false);
    c->run(loops + 1, &in, &out);
    if (matches_reference(c, &out, &wanted, true) && ++wrong)
        fprintf(stderr, "%s: %ld loops pass for %ld\n", name, loops + 1, loops);
    int at = register_to_disturb(kernel_form(c->kind), loops), odd = kernel_lanes(c) - 1;
    set_lane(&in, c->is_double, at, odd, lane(&in, c->is_double, at, odd) + 0.5);
    c->run(loops, &in, &out);
    if (matches_reference(c, &out, &wanted, true) && ++wrong)
        fprintf(stderr, "%s: another start of register %d passes\n", name, at);
    return wrong;
}

// Tests a transfer kernel with so many blocks; returns the number of faults.
static int transfer_faults(const struct transfer_kernel *m, long blocks) {
    int wrong = !transfer_is_correct(m, blocks, blocks, false);
    if (transfer_is_correct(m, blocks + 1, blocks, true) && ++wrong)
        fprintf(stderr, "%s %d bits: %ld blocks pass for %ld\n", TRANSFER_NAMES[m->kind],
                m->bits, blocks + 1, blocks);
    return wrong;
}

int main(void) {
    static const long loops[] = {1, 2, 7, 300}, blocks[] = {1, 3, 130};
    int kernels = 0, wrong = 0;
    for (int k = 0; k < ARITHMETIC_KERNEL_COUNT; k++)
        if (cpu_supports(ARITHMETIC_KERNELS[k].needs)) {
            kernels++;
            for (int i = 0; i < 4; i++)
                wrong += arithmetic_faults(&ARITHMETIC_KERNELS[k], loops[i]);
        }
    for (int k = 0; k < TRANSFER_KERNEL_COUNT; k++)
        if (cpu_supports(TRANSFER_KERNELS[k].needs)) {
            kernels++;
            for (int i = 0; i < 3; i++)
                wrong += transfer_faults(&TRANSFER_KERNELS[k], blocks[i]);
        }
    printf("%d kernels checked, %d wrong\n", kernels, wrong);
    return wrong ? WRONG_WORK : OK;
}
