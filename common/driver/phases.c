// --list: prints the ladder, phases/*/phase.json, then systems/.
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "driver/driver.h"

static int by_order(const void *a, const void *b) {
    const json_t *const *x = a, *const *y = b;
    json_int_t p = json_integer_value(json_object_get(*x, "order"));
    json_int_t q = json_integer_value(json_object_get(*y, "order"));
    return (p > q) - (p < q);
}

// Looks for phases/ in each folder above this program, which is ROOT/build/NAME/render or lies one
// folder deeper. Title, idea and order are in every phase's own phase.json, also in derived phases.
int driver_list_phases(void) {
    char path[4096] = "";
    ssize_t length = readlink("/proc/self/exe", path, sizeof path - 64);
    enum { MAX_PHASES = 256 };
    json_t *phases[MAX_PHASES];
    size_t count = 0;
    while (length > 0 && count == 0) {
        while (length > 0 && path[--length] != '/')
            continue;
        glob_t found;
        strcpy(path + length, "/phases/*/phase.json");
        if (glob(path, 0, NULL, &found) != 0)
            continue;
        strcpy(path + length, "/systems/*/phase.json");
        glob(path, GLOB_APPEND, NULL, &found);
        for (size_t i = 0; i < found.gl_pathc && count < MAX_PHASES; i++)
            if ((phases[count] = json_load_file(found.gl_pathv[i], 0, NULL)))
                count++;
        globfree(&found);
    }
    if (count == 0)
        return driver_error(BAD_INPUT, "%s: no phase found", path);
    qsort(phases, count, sizeof *phases, by_order);
    for (size_t i = 0; i < count; i++) {
        const char *name = json_string_value(json_object_get(phases[i], "name"));
        const char *title = json_string_value(json_object_get(phases[i], "title"));
        const char *idea = json_string_value(json_object_get(phases[i], "idea"));
        printf("%-10s %s: %s\n", name ? name : "?", title ? title : "?", idea ? idea : "?");
        json_decref(phases[i]);
    }
    return -1;
}
