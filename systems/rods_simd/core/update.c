// Prepares the scene and the settings.
#include <stdlib.h>

#include "core/primitives.h"
#include "phase.h"

const char *phase_unsupported(const struct scene *scene) {
    (void)scene;
    static char error[512];
    struct settings settings;
    return settings_read(getenv("STEPWISE_RODS"), &settings, error) ? NULL : error;
}

const char *phase_settings(const struct prepared *prepared) {
    return prepared->said;
}

bool phase_update(struct prepared *prepared, const struct model *model) {
    char error[512];
    if (!prepared->said[0]) { // once, by phase_prepare()
        settings_read(getenv("STEPWISE_RODS"), &prepared->settings, error);
        settings_say(&prepared->settings, prepared->said);
    }
    prepared->model = *model;
    for (int i = 0; i < model->shape_count; i++)
        prepared->primitives[i] = prepare_shape(i, &model->shapes[i], &model->march);
    list_shapes(prepared);
    return true;
}
