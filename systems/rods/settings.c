// Reads STEPWISE_RODS: words like "down=16 step=safe", separated by one blank each.
#include "settings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LARGEST = 4096 };

static const char *const FORM =
    "march=rods|pixels down=1..4096 least=1..4096 step=whole|safe picture=shaded|map";

// Reads one of two words; `out`: whether it is the second.
static bool choice(const char *value, const char *first, const char *second, bool *out) {
    *out = strcmp(value, second) == 0;
    return *out || strcmp(value, first) == 0;
}

static bool whole_number(const char *value, int *out) {
    char *end;
    long found = strtol(value, &end, 10);
    if (*value < '0' || *value > '9' || *end || found < 1 || found > LARGEST)
        return false;
    *out = (int)found;
    return true;
}

static bool set_setting(const char *key, const char *value, struct settings *settings) {
    if (strcmp(key, "march") == 0)
        return choice(value, "rods", "pixels", &settings->pixels);
    if (strcmp(key, "down") == 0)
        return whole_number(value, &settings->down);
    if (strcmp(key, "least") == 0)
        return whole_number(value, &settings->least);
    if (strcmp(key, "step") == 0)
        return choice(value, "whole", "safe", &settings->safe);
    return strcmp(key, "picture") == 0 && choice(value, "shaded", "map", &settings->map);
}

bool settings_read(const char *text, struct settings *settings, char *error) {
    *settings = (struct settings){.down = 16, .least = 1};
    while (text && *text) {
        char word[64];
        size_t length = strcspn(text, " ");
        const char *equals = memchr(text, '=', length);
        if (!equals || length >= sizeof word) {
            snprintf(error, 512, "STEPWISE_RODS: \"%.100s\": should be of %s", text, FORM);
            return false;
        }
        memcpy(word, text, length);
        word[length] = '\0';
        word[equals - text] = '\0';
        if (!set_setting(word, word + (equals - text) + 1, settings)) {
            snprintf(error, 512, "STEPWISE_RODS: \"%.*s\": should be of %s", (int)length, text,
                     FORM);
            return false;
        }
        text += length + (text[length] == ' ');
    }
    return true;
}

void settings_say(const struct settings *settings, char *text) {
    snprintf(text, 128, "march=%s down=%d least=%d step=%s picture=%s",
             settings->pixels ? "pixels" : "rods", settings->down, settings->least,
             settings->safe ? "safe" : "whole", settings->map ? "map" : "shaded");
}
