// Prepares a phase, renders and times frames, by the calls of the driver.
#include "viewer/stage.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "timing/timer.h"

static bool refused(const struct stage *stage, const char *reason, char *error) {
    snprintf(error, SCENE_ERROR_SIZE, "%s: %.800s", stage->phase->name, reason);
    return false;
}

// Phases read STEPWISE_RODS while they are prepared. One thread's setenv must not meet another's getenv.
static pthread_rwlock_t environment = PTHREAD_RWLOCK_INITIALIZER;
static atomic_int changes;

void stage_settings(const char *words) {
    static const char name[] = "STEPWISE_RODS";
    static char *first;
    pthread_rwlock_wrlock(&environment);
    if (!first && getenv(name))
        first = strdup(getenv(name));
    if (!words)
        words = first;
    if (words)
        setenv(name, words, 1);
    else
        unsetenv(name);
    atomic_fetch_add(&changes, 1);
    pthread_rwlock_unlock(&environment);
}

bool stage_outdated(const struct stage *stage) {
    return stage->settings != atomic_load(&changes);
}

static bool open_alone(struct stage *stage, const struct viewer_phase *phase,
                       const struct world *world, int threads, char *error) {
    *stage = (struct stage){.phase = phase,
                            .world = world,
                            .threads = phase->threads ? threads : 1,
                            .settings = atomic_load(&changes)};
    const char *missing = phase->missing();
    if (missing) {
        snprintf(error, SCENE_ERROR_SIZE, "%s needs %s, which this CPU lacks", phase->name,
                 missing);
        return false;
    }
    const char *unsupported = why_unsupported(phase, &world->scene);
    if (unsupported)
        return refused(stage, unsupported, error);
    const struct model *model = &world->scene.model;
    if (model_copy(model, &stage->moving))
        stage->prepared = phase->prepare(model, stage->threads);
    if (stage->prepared)
        return true;
    free(stage->moving.shapes);
    stage->moving.shapes = NULL;
    return refused(stage, "out of memory while preparing the scene", error);
}

bool stage_open(struct stage *stage, const struct viewer_phase *phase, const struct world *world,
                int threads, char *error) {
    stage_close(stage);
    pthread_rwlock_rdlock(&environment);
    bool opened = open_alone(stage, phase, world, threads, error);
    pthread_rwlock_unlock(&environment);
    return opened;
}

// Makes the frame anew if its size or its planes are others.
static bool fit_frame(struct stage *stage, int width, int height, bool aov) {
    struct frame *frame = &stage->frame;
    if (frame->rgb && frame->width == width && frame->height == height &&
        (frame->depth != NULL) == aov)
        return true;
    frame_free(frame);
    return frame_create(frame, width, height, aov, stage->phase->planes);
}

bool stage_render(struct stage *stage, const struct view *view, double seconds, int width,
                  int height, bool aov, char *error) {
    const struct viewer_phase *phase = stage->phase;
    const struct model *model = &stage->world->scene.model;
    const char *unsupported = phase->picture_unsupported
                                  ? phase->picture_unsupported(&stage->world->scene, width, height)
                                  : NULL;
    if (unsupported)
        return refused(stage, unsupported, error);
    if (!fit_frame(stage, width, height, aov))
        return refused(stage, "out of memory", error);
    if (model->animated)
        model_move(model, seconds, &stage->moving);
    stage->ns = timer_ns();
    bool done = !model->animated || phase->update(stage->prepared, &stage->moving);
    done = done && phase->render(stage->prepared, view, &stage->frame);
    stage->ns = timer_ns() - stage->ns;
    return done || refused(stage, "out of memory while rendering", error);
}

void stage_close(struct stage *stage) {
    if (stage->prepared)
        stage->phase->release(stage->prepared);
    free(stage->moving.shapes);
    frame_free(&stage->frame);
    *stage = (struct stage){0};
}
