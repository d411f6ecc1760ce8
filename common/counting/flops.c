// Counts calls and multiplies them by declared costs, for build/NAME/render-count. See flops.h.
#include "counting/flops.h"

#include <stdlib.h>
#include <string.h>

#include "counting/count.h"
#include "driver/variant.h"

// LANES as a width in costs.def: the number of lanes of the variant that runs.
enum { LANES = 0, CLASSES = 9 };

static const char *const class_names[CLASSES] = {"add",   "mul",    "fma",     "div", "sqrt",
                                                 "rsqrt", "minmax", "compare", "call"};
enum { ADD, MUL, FMA, DIV, SQRT, RSQRT, MINMAX, COMPARE, CALL };

static const struct cost {
    const char *function, *part;
    unsigned width;
    unsigned per_lane[CLASSES];
    bool stands_for_call;
} costs[FLOPS_PARTS] = {
#define LINE(f, p, w, a, m, x, d, s, r, n, c, k, math)                                             \
    {#f, #p, w, {a, m, x, d, s, r, n, c, k}, math},
#define COST(f, p, w, a, m, x, d, s, r, n, c, k) LINE(f, p, w, a, m, x, d, s, r, n, c, k, false)
#define COST_MATH(f, p, w, a, m, x, d, s, r, n, c, k) LINE(f, p, w, a, m, x, d, s, r, n, c, k, true)
#include "costs.def"
};

_Thread_local struct flops_tally flops_tally[FLOPS_PARTS];
_Thread_local unsigned flops_active = 1;

uint64_t *tally_own(size_t *size) {
    *size = 2 * FLOPS_PARTS; // calls and lanes of part 0, calls and lanes of part 1, …
    return &flops_tally[0].calls;
}

// FLOPs per lane by the two conventions of flops.h.
static uint64_t machine(const struct cost *c) {
    const unsigned *n = c->per_lane;
    return n[ADD] + n[MUL] + 2u * n[FMA] + n[DIV] + n[SQRT] + n[RSQRT] + n[MINMAX];
}

static uint64_t paper(const struct cost *c) {
    if (c->stands_for_call)
        return strcmp(c->part, "call") == 0;
    return machine(c) + c->per_lane[CALL];
}

// Adds to a whole number of the object, which starts at 0.
static bool add(json_t *object, const char *key, uint64_t more) {
    json_int_t so_far = json_integer_value(json_object_get(object, key));
    return json_object_set_new(object, key, json_integer(so_far + (json_int_t)more)) == 0;
}

// Returns the object's member `key`, a new object if there is none yet.
static json_t *child(json_t *object, const char *key) {
    json_t *found = json_object_get(object, key);
    if (!found && json_object_set_new(object, key, json_object()) == 0)
        found = json_object_get(object, key);
    return found;
}

// Adds part i's counts to its function's object, to the classes and to the totals.
static bool account(size_t i, const uint64_t *counted, json_t *function, json_t *classes,
                    uint64_t total[4]) {
    const struct cost *c = &costs[i];
    uint64_t calls = counted[2 * i];
    unsigned width = c->width == LANES ? (unsigned)variant_here().lanes : c->width;
    uint64_t executed = calls * width, useful = c->width == 1 ? calls : counted[2 * i + 1];
    bool entry = strcmp(c->part, "call") == 0, ok = true;
    total[0] += executed * paper(c);
    total[1] += executed * machine(c);
    total[2] += useful * machine(c);
    total[3] += useful * paper(c);
    ok &= add(function, "calls", entry ? calls : 0) && add(function, "lanes", entry ? useful : 0);
    ok &= add(function, "paper", executed * paper(c));
    ok &= add(function, "machine", executed * machine(c));
    ok &= add(function, "useful", useful * machine(c));
    ok &= add(child(function, "parts"), c->part, calls);
    for (size_t k = 0; k < CLASSES; k++)
        ok &= add(classes, class_names[k], executed * c->per_lane[k]);
    if (c->stands_for_call && entry)
        ok &= add(classes, class_names[CALL], executed);
    return ok;
}

json_t *count_result(void) {
    const uint64_t *counted = tally_counted();
    json_t *functions = json_object(), *classes = json_object();
    uint64_t total[4] = {0}; // paper, machine, useful machine, useful paper FLOPs
    bool ok = functions && classes && counted;
    for (size_t i = 0; ok && i < FLOPS_PARTS; i++)
        ok = account(i, counted, child(functions, costs[i].function), classes, total);
    if (!ok) {
        json_decref(functions);
        json_decref(classes);
        return NULL;
    }
    return json_pack("{s:s, s:{s:I, s:I}, s:o, s:o, s:I, s:I, s:I}", "counts", "declared costs",
                     "flops", "paper", (json_int_t)total[0], "machine", (json_int_t)total[1],
                     "by_function", functions, "by_class", classes, "executed",
                     (json_int_t)total[1], "useful", (json_int_t)total[2], "useful_paper",
                     (json_int_t)total[3]);
}
