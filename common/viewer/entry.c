// One phase's entry in the table of phases. Compiled once for each phase (viewer.mk).
#include "phase_info.h"
#include "viewer/phases.h"

static const char *const PLANES[] = {PHASE_PLANES NULL};

static const struct viewer_phase ENTRY = {
    .name = PHASE_NAME,
    .precision = PHASE_PRECISION,
    .threads = PHASE_THREADS,
    .groups = PHASE_GROUPS,
    .planes = PLANES,
    .missing = variant_missing,
    .variant = variant_here,
    .unsupported = phase_unsupported,
    .picture_unsupported = phase_picture_unsupported,
    .prepare = phase_prepare,
    .update = phase_update,
    .render = phase_render,
    .release = phase_release,
    .kernel = phase_kernel,
};

// The linker puts the pointers of all phases next to each other: that is the table.
static const struct viewer_phase *phase_entry __attribute__((used, section("viewer_phases"))) =
    &ENTRY;
