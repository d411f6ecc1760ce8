// A phase that is prepared for a scene, and the frame it draws.
#pragma once

#include "viewer/phases.h"
#include "viewer/world.h"

struct stage {
    const struct viewer_phase *phase;
    const struct world *world;
    int threads, settings;     // which stage_settings it was opened under
    struct prepared *prepared; // NULL: closed
    struct model moving;       // of an animated scene: where the shapes are
    struct frame frame;
    uint64_t ns; // of the last frame: phase_update and phase_render, as the driver times them
};

// Opens a phase for a scene; closes what `stage` had before. Returns false with the reason in
// `error` (SCENE_ERROR_SIZE bytes); the stage is then closed.
bool stage_open(struct stage *stage, const struct viewer_phase *phase, const struct world *world,
                int threads, char *error);
// Sets STEPWISE_RODS for stages that are opened from now on, by any thread; NULL: as it was at the start.
void stage_settings(const char *words);
// Returns whether the settings have changed since the stage was opened.
bool stage_outdated(const struct stage *stage);
// Renders the view at width x height pixels; `aov`: with depth, id, normal and evaluations.
bool stage_render(struct stage *stage, const struct view *view, double seconds, int width,
                  int height, bool aov, char *error);
void stage_close(struct stage *stage);
