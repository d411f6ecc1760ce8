// Calls times declared costs, for build/NAME/render-count. See flops.h.
#include "counting/flops.h"

#include <stdlib.h>
#include <string.h>

#include "counting/count.h"
#include "driver/variant.h"

// A width of LANES lanes is as many as the variant has that runs.
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

enum { COUNTERS = 2 * FLOPS_PARTS };
// Calls and lanes by turns, as in struct flops_tally.
static uint64_t before[COUNTERS], counted[COUNTERS];
static bool complete = true;

uint64_t *tally_own(size_t *size) {
    *size = COUNTERS;
    return &flops_tally[0].calls;
}

void count_begin(void) {
    complete = tally_sum(before, COUNTERS) && complete;
}

void count_end(void) {
    complete = tally_sum(counted, COUNTERS) && complete;
    for (size_t i = 0; i < COUNTERS; i++)
        counted[i] -= before[i];
}

static uint64_t machine(const struct cost *c) {
    const unsigned *n = c->per_lane;
    return n[ADD] + n[MUL] + 2u * n[FMA] + n[DIV] + n[SQRT] + n[RSQRT] + n[MINMAX];
}

static uint64_t paper(const struct cost *c) {
    if (c->stands_for_call)
        return strcmp(c->part, "call") == 0;
    return machine(c) + c->per_lane[CALL];
}

// Adds to a whole number of the object.
static bool add(json_t *object, const char *key, uint64_t more) {
    json_int_t so_far = json_integer_value(json_object_get(object, key));
    return json_object_set_new(object, key, json_integer(so_far + (json_int_t)more)) == 0;
}

static json_t *child(json_t *object, const char *key) {
    json_t *found = json_object_get(object, key);
    if (!found && json_object_set_new(object, key, json_object()) == 0)
        found = json_object_get(object, key);
    return found;
}

// Part i's counts into the function's object and into the totals.
static bool account(size_t i, json_t *function, json_t *classes, uint64_t total[4]) {
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
    json_t *functions = json_object(), *classes = json_object();
    uint64_t total[4] = {0}; // paper, machine, useful of the machine's, useful of the paper's
    bool ok = functions && classes && complete;
    for (size_t i = 0; ok && i < FLOPS_PARTS; i++)
        ok = account(i, child(functions, costs[i].function), classes, total);
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
