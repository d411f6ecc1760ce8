// All phases in one program. Each defines the same symbols (phase.h), so the build joins build/NAME/phase.o
// with its entry (entry.c), makes every symbol local and links the results (viewer.mk). The window then runs
// the very machine code that build/NAME/render times.
#pragma once

#include "driver/variant.h"
#include "phase.h"

// A phase's functions, and what phase_info.h says of it.
struct viewer_phase {
    const char *name, *precision;
    bool threads;              // may use more than one
    bool groups;               // draws groups of shapes
    const char *const *planes; // its own, ending with NULL
    const char *(*missing)(void);
    struct variant (*variant)(void);
    const char *(*unsupported)(const struct scene *scene); // or NULL, as the next
    const char *(*picture_unsupported)(const struct scene *scene, int width, int height);
    struct prepared *(*prepare)(const struct model *model, int threads);
    bool (*update)(struct prepared *prepared, const struct model *model);
    bool (*render)(const struct prepared *prepared, const struct view *view, struct frame *frame);
    void (*release)(struct prepared *prepared);
    const struct kernel_facts *(*kernel)(
        const struct prepared *prepared); // or NULL: generates none
};

static inline const char *why_unsupported(const struct viewer_phase *phase,
                                          const struct scene *scene) {
    const char *no = groups_unsupported(phase->groups, scene);
    return no || !phase->unsupported ? no : phase->unsupported(scene);
}

// Sorts the phases: the ladder first, then the others by name. Called once, before the functions below.
void phases_sort(void);
int phases_count(void);
const struct viewer_phase *phases_at(int index);

// Returns the index of the phase called `name`, -1 if it is not linked.
int phases_find(const char *name);
// Returns the index of the ladder's phase `number` (0: baseline), -1 if it is not linked.
int phases_of_number(int number);
