// Reads, plays and records camera paths.
#include "viewer/script.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "viewer/show.h"

enum { MAX_FRAMES = 1000000 };
static const char KEYS[] =
    "scene, phase, reference, mode, divider, amplify, position, look_at, up, "
    "light, seconds and frames are";

static const char *const VECTORS[] = {"position", "look_at", "up", "light", NULL};

static double *vector_of(struct camera *camera, int index) {
    double *const vectors[] = {camera->position, camera->look_at, camera->up, camera->light};
    return vectors[index];
}

static bool is_vector(const json_t *value) {
    bool good = json_array_size(value) == 3;
    for (size_t i = 0; good && i < 3; i++)
        good = json_is_number(json_array_get(value, i)) &&
               isfinite(json_number_value(json_array_get(value, i)));
    return good;
}

// Returns what a member must be if its value is none, NULL if it is one, KEYS if there is no such key.
static const char *wanted(const char *key, const json_t *value) {
    for (int i = 0; VECTORS[i]; i++)
        if (strcmp(key, VECTORS[i]) == 0)
            return is_vector(value) ? NULL : "three numbers";
    if (strcmp(key, "scene") == 0 || strcmp(key, "phase") == 0 || strcmp(key, "reference") == 0)
        return json_is_string(value) ? NULL : "a name";
    if (strcmp(key, "mode") == 0)
        return json_is_string(value) && mode_find(json_string_value(value)) != MODES
                   ? NULL
                   : "colours, difference, evals, depth, normals or ids";
    if (strcmp(key, "seconds") == 0)
        return json_is_number(value) ? NULL : "a number";
    if (strcmp(key, "amplify") == 0)
        return json_number_value(value) > 0 ? NULL : "a positive number";
    if (strcmp(key, "divider") == 0)
        return json_is_false(value) || (json_is_number(value) && json_number_value(value) >= 0 &&
                                        json_number_value(value) <= 1)
                   ? NULL
                   : "a number from 0 to 1, or false";
    if (strcmp(key, "frames") == 0)
        return json_integer_value(value) >= 1 && json_integer_value(value) <= MAX_FRAMES
                   ? NULL
                   : "a whole number from 1 to 1000000";
    return KEYS;
}

static bool check_line(const char *path, int number, const json_t *line, char *error) {
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)line, key, value) {
        const char *required = wanted(key, value);
        if (required == KEYS)
            snprintf(error, SCENE_ERROR_SIZE, "%.300s:%d: %.60s is no key of a path; %s", path,
                     number, key, KEYS);
        else if (required)
            snprintf(error, SCENE_ERROR_SIZE, "%.300s:%d: %.60s: %s is required", path, number, key,
                     required);
        if (required)
            return false;
    }
    return true;
}

bool script_read(struct script *script, const char *path, char *error) {
    *script = (struct script){.path = path, .lines = json_array()};
    FILE *file = fopen(path, "r");
    if (!file || !script->lines) {
        snprintf(error, SCENE_ERROR_SIZE, "%.300s: cannot read the script: %s", path,
                 strerror(errno));
        if (file)
            fclose(file);
        script_free(script);
        return false;
    }
    char *text = NULL;
    size_t size = 0;
    bool good = true;
    for (int number = 1; good && getline(&text, &size, file) >= 0; number++) {
        if (text[strspn(text, " \t\r\n")] == '\0')
            continue;
        json_error_t broken;
        json_t *line = json_loads(text, JSON_REJECT_DUPLICATES, &broken);
        if (!json_is_object(line)) {
            snprintf(error, SCENE_ERROR_SIZE, "%.300s:%d: %s", path, number,
                     line ? "a JSON object is required" : broken.text);
            good = false;
        } else
            good = check_line(path, number, line, error);
        if (!line || json_array_append_new(script->lines, line) != 0)
            good = false;
    }
    free(text);
    fclose(file);
    if (good && json_array_size(script->lines) == 0) {
        snprintf(error, SCENE_ERROR_SIZE, "%.300s: no frame; a JSON object a line is required",
                 path);
        good = false;
    }
    if (!good)
        script_free(script);
    return good;
}

void script_free(struct script *script) {
    json_decref(script->lines);
    script->lines = NULL;
}

static const struct viewer_phase *named(const json_t *line, const char *key,
                                        const struct viewer_phase *otherwise, char *error) {
    const char *name = json_string_value(json_object_get(line, key));
    int index = name ? phases_find(name) : -1;
    if (name && index < 0)
        snprintf(error, SCENE_ERROR_SIZE,
                 "%s: \"%.60s\" is no phase of this program; viewer --list", key, name);
    return !name ? otherwise : index < 0 ? NULL : phases_at(index);
}

// Takes scene, phases and modes of a line; the camera goes to script->to.
static bool begin_line(struct script *script, const json_t *line, struct show *show, char *error) {
    const char *scene = json_string_value(json_object_get(line, "scene"));
    const struct world *world = scene ? world_open(scene, error) : show->world;
    const struct viewer_phase *phase = world ? named(line, "phase", show->left.phase, error) : NULL;
    const struct viewer_phase *reference =
        phase ? named(line, "reference", show->reference, error) : NULL;
    if (!reference)
        return false;
    if ((world != show->world || phase != show->left.phase) &&
        !show_open(show, phase, world, error))
        return false;
    if (reference != show->reference && !show_reference(show, reference, error))
        return false;
    const json_t *divider = json_object_get(line, "divider");
    if (divider)
        show->split = !json_is_false(divider);
    if (json_is_number(divider))
        show->divider = json_number_value(divider);
    const char *mode = json_string_value(json_object_get(line, "mode"));
    if (mode)
        show->mode = mode_find(mode);
    if (json_object_get(line, "amplify"))
        show->amplify = json_number_value(json_object_get(line, "amplify"));
    script->from = script->to = show->camera;
    for (int v = 0; VECTORS[v]; v++)
        for (size_t i = 0; json_object_get(line, VECTORS[v]) && i < 3; i++)
            vector_of(&script->to, v)[i] =
                json_number_value(json_array_get(json_object_get(line, VECTORS[v]), i));
    if (json_object_get(line, "position") || json_object_get(line, "look_at"))
        script->to.flies = script->from.flies = 0;
    if (json_object_get(line, "seconds"))
        script->to.seconds = json_number_value(json_object_get(line, "seconds"));
    json_int_t frames = json_integer_value(json_object_get(line, "frames"));
    script->steps = frames > 0 ? (int)frames : 1;
    script->step = 0;
    return true;
}

int script_next(struct script *script, struct show *show, char *error) {
    if (script->step == script->steps) {
        if (script->line == json_array_size(script->lines))
            return 0;
        const json_t *line = json_array_get(script->lines, script->line++);
        if (!begin_line(script, line, show, error))
            return -1;
    }
    script->step++;
    double part = (double)script->step / script->steps;
    bool last = script->step == script->steps; // exact, so that a recording plays bit for bit
    for (int v = 0; VECTORS[v]; v++)
        for (int i = 0; i < 3; i++) {
            double from = vector_of(&script->from, v)[i], to = vector_of(&script->to, v)[i];
            vector_of(&show->camera, v)[i] = last ? to : from + part * (to - from);
        }
    double from = script->from.seconds, to = script->to.seconds;
    show->camera.seconds = last ? to : from + part * (to - from);
    show->camera.flies = script->to.flies;
    camera_fly(show->world, &show->camera);
    struct view view = show->world->scene.view;
    memcpy(view.position, show->camera.position, sizeof view.position);
    if (view_aim(&view, show->camera.look_at, show->camera.up) == AIM_OK)
        return 1;
    snprintf(error, SCENE_ERROR_SIZE,
             "%.300s: frame %zu: look_at is the camera's position, or up is parallel to the view",
             script->path, script->line);
    return -1;
}

static json_t *three(const double from[3]) {
    return json_pack("[fff]", from[0], from[1], from[2]);
}

bool script_record(FILE *file, const struct show *show) {
    const struct camera *camera = &show->camera;
    json_t *line =
        json_pack("{ss ss ss ss sf so so so so sf}", "scene", world_called(show->world), "phase",
                  show->left.phase->name, "reference", show->reference->name, "mode",
                  mode_name(show->mode), "amplify", show->amplify, "position",
                  three(camera->position), "look_at", three(camera->look_at), "up",
                  three(camera->up), "light", three(camera->light), "seconds", camera->seconds);
    bool done =
        line && json_object_set_new(line, "divider",
                                    show->split ? json_real(show->divider) : json_false()) == 0;
    done = done && json_dumpf(line, file, JSON_COMPACT | JSON_REAL_PRECISION(17)) == 0 &&
           fputc('\n', file) != EOF;
    json_decref(line);
    return done;
}
