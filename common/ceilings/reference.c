// See reference.h.
#include "reference.h"

#include <math.h>
#include <stdio.h>

// Operands with many significant digits in every lane: older dividers finish early on short
// quotients.
static const double FACTOR = 1.00001537, ADDEND = 0.3719;

void initial_registers(const struct arithmetic_kernel *c, union registers *r) {
    enum form form = kernel_form(c->kind);
    for (int at = 0; at < REGISTERS; at++)
        for (int i = 0; i < SLOT / (c->is_double ? 8 : 4); i++) {
            int place = at % BANK;
            double value = 1.0371 + 0.25 * place + 0.0137 * i + 0.05 * (at / BANK);
            if (form == RUNNING_MAX && place == 12)
                value = 6 + 0.0137 * i; // larger than the registers that take its maximum
            if (place == 14)
                value = form != CHAINED || c->kind == ADD ? ADDEND : FACTOR;
            if (place == 15)
                value = ADDEND;
            set_lane(r, c->is_double, at, i, value);
        }
}

// An fma of arm64 adds to what stands in the register, one of x86-64 multiplies it.
static double fused(bool is_double, double x) {
#ifdef __aarch64__
    double a = FACTOR, b = ADDEND, c = x;
#else
    double a = x, b = FACTOR, c = ADDEND;
#endif
    return is_double ? fma(a, b, c) : (double)fmaf((float)a, (float)b, (float)c);
}

// One step of a CHAINED kernel in register `at` of its bank, rounded to the kernel's precision.
static double step(const struct arithmetic_kernel *c, int at, double x) {
    enum kind kind = c->kind == ADD_MUL       ? (at % 2 ? MUL : ADD)
                     : c->kind == ADD_2MUL    ? (at % 3 ? MUL : ADD)
                     : c->kind == TWO_ADD_MUL ? (at % 3 ? ADD : MUL)
                                              : c->kind;
    double by = c->kind == ADD ? ADDEND : FACTOR;
    if (kind == FMA)
        return fused(c->is_double, x);
    if (c->is_double)
        return kind == ADD ? x + by : kind == MUL ? x * by : x / by;
    float y = (float)x, f = (float)by;
    return kind == ADD ? y + f : kind == MUL ? y * f : y / f;
}

// Adds ADDEND to x so many times, rounded to the precision.
static double add_repeatedly(bool is_double, double x, long times) {
    float y = (float)x;
    for (long n = 0; n < times; n++)
        if (is_double)
            x += ADDEND;
        else
            y += (float)ADDEND;
    return is_double ? x : (double)y;
}

// Lane i of the registers from `bank` on.
static void reference_lane(const struct arithmetic_kernel *c, long loops, const union registers *in,
                           union registers *out, int bank, int i) {
    bool d = c->is_double;
    switch (kernel_form(c->kind)) {
    case CHAINED:
        for (int at = 0; at < 14; at++) {
            double x = lane(in, d, bank + at, i);
            for (long n = 0; n < BODY_REPEATS * loops; n++)
                x = step(c, at, x);
            set_lane(out, d, bank + at, i, x);
        }
        break;
    case FROM_RISING:
        for (int at = 10; at < 14; at++) {
            double last = add_repeatedly(d, lane(in, d, bank + at, i), BODY_REPEATS * loops - 1);
            set_lane(out, d, bank + at, i, add_repeatedly(d, last, 1));
            for (int t = at - 10; t < 10; t += 4)
                set_lane(out, d, bank + t, i,
                         c->kind == RSQRT ? 1 / sqrt(last)
                         : d              ? sqrt(last)
                                          : (double)sqrtf((float)last));
        }
        break;
    case RUNNING_MAX: {
        double last = add_repeatedly(d, lane(in, d, bank + 12, i), loops - 1);
        for (int at = 0; at < 12; at++)
            set_lane(out, d, bank + at, i, last);
        set_lane(out, d, bank + 12, i, add_repeatedly(d, last, 1));
    }
    }
}

void reference_result(const struct arithmetic_kernel *c, long loops, const union registers *in,
                      union registers *out) {
    *out = *in;
    for (int bank = 0; bank < REGISTERS; bank += BANK)
        for (int i = 0; i < kernel_lanes(c); i++)
            reference_lane(c, loops, in, out, bank, i);
}

bool matches_reference(const struct arithmetic_kernel *c, const union registers *found,
                       const union registers *wanted, bool quiet) {
    for (int at = 0; at < REGISTERS; at++)
        for (int i = 0; i < kernel_lanes(c); i++) {
            double x = lane(found, c->is_double, at, i), y = lane(wanted, c->is_double, at, i);
            double allowed = at % BANK < 10 ? c->tolerance * fabs(y) : 0;
            if (!(fabs(x - y) <= allowed)) {
                char name[64];
                kernel_name(c, name);
                if (!quiet)
                    fprintf(stderr,
                            "ceilings: %s: register %d, lane %d is %.17g, must be %.17g: the "
                            "kernel did not do its work\n",
                            name, at, i, x, y);
                return false;
            }
        }
    return true;
}
