// Reads STEPWISE_FIXED: words like "bits=24 clear=safe", separated by one blank each.
#include <stdio.h>
#include <string.h>

#include "config.h"
#include "number/format.h"

enum { CLEARS = 4 };

static const char *const NAMES[CLEARS] = {"corners", "safe", "lists", "never"}; // of enum clear

static bool set_clear(const char *value, struct settings *s) {
    for (int i = 0; i < CLEARS; i++)
        if (strcmp(value, NAMES[i]) == 0) {
            s->clear = (enum clear)i;
            return true;
        }
    return false;
}

bool settings_read(const char *text, struct settings *s, char *error) {
    *s = DEFAULTS;
    while (text && *text) {
        char word[64];
        size_t length = strcspn(text, " ");
        const char *equals = memchr(text, '=', length);
        bool good = equals && length < sizeof word;
        if (good) {
            memcpy(word, text, length);
            word[length] = '\0';
            word[equals - text] = '\0';
            const char *value = word + (equals - text) + 1;
            good = strcmp(word, "clear") == 0 ? set_clear(value, s) : format_set(word, value, s);
        }
        if (!good) {
            snprintf(error, 512, "STEPWISE_FIXED: \"%.*s\": should be of %sclear=%s|%s|%s|%s",
                     (int)(length < 100 ? length : 100), text, FORMAT_USAGE, NAMES[0], NAMES[1],
                     NAMES[2], NAMES[3]);
            return false;
        }
        text += length + (text[length] == ' ');
    }
    return true;
}

void settings_say(const struct format *f, char *text) {
    char number[96];
    format_say(f, number, sizeof number);
    snprintf(text, 128, "%sclear=%s", number, NAMES[f->clear]);
}
