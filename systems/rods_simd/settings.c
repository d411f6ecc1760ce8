// STEPWISE_RODS: words like "size=32 steps=12", parted by one space.
#include "settings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LARGEST = 64, MOST = 1000000 };

static const char *const FORM =
    "march=rods|pixels size=1|2|4|...|64 least=1|2|4|...|size steps=0..1000000 finish=0..1000000";

static bool number(const char *value, int least, int most, int *out) {
    char *end;
    long found = strtol(value, &end, 10);
    if (*value < '0' || *value > '9' || *end || found < least || found > most)
        return false;
    *out = (int)found;
    return true;
}

static bool power_of_two(const char *value, int *out) {
    return number(value, 1, LARGEST, out) && (*out & (*out - 1)) == 0;
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
        return number(value, 0, MOST, &settings->steps);
    return strcmp(key, "finish") == 0 && number(value, 0, MOST, &settings->finish);
}

bool settings_read(const char *text, struct settings *settings, char *error) {
    *settings = (struct settings){.size = 32, .least = 8};
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
        if (!set_one(word, word + (equals - text) + 1, settings)) {
            snprintf(error, 512, "STEPWISE_RODS: \"%.*s\": should be of %s", (int)length, text,
                     FORM);
            return false;
        }
        text += length + (text[length] == ' ');
    }
    if (settings->least > settings->size) {
        snprintf(error, 512, "STEPWISE_RODS: least=%d is more than size=%d: should be at most that",
                 settings->least, settings->size);
        return false;
    }
    return true;
}

void settings_say(const struct settings *settings, char *text) {
    snprintf(text, 128, "march=%s size=%d least=%d steps=%d finish=%d",
             settings->pixels ? "pixels" : "rods", settings->size, settings->least, settings->steps,
             settings->finish);
}
