// STEPWISE_RODS: words like "size=32 steps=12", parted by one space.
#include "settings.h"

#include <stdio.h>
#include <string.h>

#include "scene/words.h"

enum { LARGEST = 64, MOST = 1000000 };

static const char *const FORM =
    "march=rods|pixels size=1|2|4|...|64 least=1|2|4|...|size steps=0..1000000 finish=0..1000000";

static bool power_of_two(const char *value, int *out) {
    return word_number(value, 1, LARGEST, out) && (*out & (*out - 1)) == 0;
}

static bool set_one(const char *key, const char *value, struct settings *settings) {
    if (strcmp(key, "march") == 0) {
        settings->pixels = strcmp(value, "pixels") == 0;
        return settings->pixels || strcmp(value, "rods") == 0;
    }
    if (strcmp(key, "size") == 0)
        return power_of_two(value, &settings->size);
    if (strcmp(key, "least") == 0)
        return power_of_two(value, &settings->least);
    if (strcmp(key, "steps") == 0)
        return word_number(value, 0, MOST, &settings->steps);
    return strcmp(key, "finish") == 0 && word_number(value, 0, MOST, &settings->finish);
}

bool settings_read(const char *text, struct settings *settings, char *error) {
    *settings = (struct settings){.size = 32, .least = 8};
    if (!words_read(text, "STEPWISE_RODS", FORM, set_one, settings, error))
        return false;
    if (settings->least <= settings->size)
        return true;
    snprintf(error, 512, "STEPWISE_RODS: least=%d is more than size=%d: should be at most that",
             settings->least, settings->size);
    return false;
}

void settings_say(const struct settings *settings, char *text) {
    snprintf(text, 128, "march=%s size=%d least=%d steps=%d finish=%d",
             settings->pixels ? "pixels" : "rods", settings->size, settings->least, settings->steps,
             settings->finish);
}
