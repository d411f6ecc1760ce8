// Reads STEPWISE_FIXED: words like "bits=24 clear=safe", separated by one blank each.
#include <stdio.h>
#include <string.h>

#include "config.h"
#include "number/format.h"
#include "scene/words.h"

enum { CLEARS = 4 };

static const char *const NAMES[CLEARS] = {"corners", "safe", "lists", "never"}; // of enum clear

static bool set_setting(const char *key, const char *value, struct settings *s) {
    int clear;
    if (strcmp(key, "clear") != 0)
        return format_set(key, value, s);
    if (!word_among(value, NAMES, CLEARS, &clear))
        return false;
    s->clear = (enum clear)clear;
    return true;
}

bool settings_read(const char *text, struct settings *s, char *error) {
    *s = DEFAULTS;
    return words_read(text, "STEPWISE_FIXED", SETTINGS_FORM, set_setting, s, error);
}

void settings_say(const struct format *f, char *text) {
    char number[96];
    format_say(f, number, sizeof number);
    snprintf(text, 128, "%sclear=%s", number, NAMES[f->clear]);
}
