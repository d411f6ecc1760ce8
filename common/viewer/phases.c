// The table of phases, which the linker makes of the section viewer_phases.
#include "viewer/phases.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

extern const struct viewer_phase *__start_viewer_phases[], *__stop_viewer_phases[];

// Position on the ladder: baseline is 0, optK is K. Returns -1 for any other phase.
static int ladder_number(const char *name) {
    int number;
    if (strcmp(name, "baseline") == 0)
        return 0;
    return sscanf(name, "opt%d", &number) == 1 ? number : -1;
}

static int by_ladder(const void *a, const void *b) {
    const char *x = (*(const struct viewer_phase *const *)a)->name;
    const char *y = (*(const struct viewer_phase *const *)b)->name;
    unsigned p = (unsigned)ladder_number(x), q = (unsigned)ladder_number(y); // -1 comes last
    return p != q ? (p > q) - (p < q) : strcmp(x, y);
}

int phases_count(void) {
    return (int)(__stop_viewer_phases - __start_viewer_phases);
}

void phases_sort(void) {
    qsort(__start_viewer_phases, (size_t)phases_count(), sizeof *__start_viewer_phases, by_ladder);
}

const struct viewer_phase *phases_at(int index) {
    return __start_viewer_phases[index];
}

int phases_find(const char *name) {
    for (int i = 0; i < phases_count(); i++)
        if (strcmp(phases_at(i)->name, name) == 0)
            return i;
    return -1;
}

int phases_of_number(int number) {
    for (int i = 0; i < phases_count(); i++)
        if (ladder_number(phases_at(i)->name) == number)
            return i;
    return -1;
}
