// Reads STEPWISE_RODS: words like "down=16 step=safe", separated by one blank each.
#include "settings.h"

#include <stdio.h>
#include <string.h>

#include "scene/words.h"

enum { LARGEST = 4096 };

static const char *const FORM =
    "march=rods|pixels down=1..4096 least=1..4096 step=whole|safe picture=shaded|map";
static const char *const MARCHES[] = {"rods", "pixels"}, *const STEPS[] = {"whole", "safe"},
                         *const PICTURES[] = {"shaded", "map"};

// Reads one of two words; `out`: whether it is the second.
static bool choice(const char *value, const char *const words[2], bool *out) {
    int found;
    bool there = word_among(value, words, 2, &found);
    *out = found == 1;
    return there;
}

static bool set_setting(const char *key, const char *value, struct settings *settings) {
    if (strcmp(key, "march") == 0)
        return choice(value, MARCHES, &settings->pixels);
    if (strcmp(key, "down") == 0)
        return word_number(value, 1, LARGEST, &settings->down);
    if (strcmp(key, "least") == 0)
        return word_number(value, 1, LARGEST, &settings->least);
    if (strcmp(key, "step") == 0)
        return choice(value, STEPS, &settings->safe);
    return strcmp(key, "picture") == 0 && choice(value, PICTURES, &settings->map);
}

bool settings_read(const char *text, struct settings *settings, char *error) {
    *settings = (struct settings){.down = 16, .least = 1};
    return words_read(text, "STEPWISE_RODS", FORM, set_setting, settings, error);
}

void settings_say(const struct settings *settings, char *text) {
    snprintf(text, 128, "march=%s down=%d least=%d step=%s picture=%s", MARCHES[settings->pixels],
             settings->down, settings->least, STEPS[settings->safe], PICTURES[settings->map]);
}
