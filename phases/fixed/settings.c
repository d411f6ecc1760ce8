// STEPWISE_FIXED: words like "bits=24 unit=auto", parted by one space.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "format.h"
#include "own.h"

static const char *const FORM =
    "bits=8..28 unit=1|2|4|…|1024|auto roots=article|1|2|3|4 clear=corners|safe|lists|never";
static const char *const CLEARS[] = {"corners", "safe", "lists", "never"};
static const char *const ROOTS[] = {"article", "1", "2", "3", "4"};

// Which of the words it is; −1: none.
static int word_of(const char *value, const char *const *words, int count) {
    for (int i = 0; i < count; i++)
        if (strcmp(value, words[i]) == 0)
            return i;
    return -1;
}

static bool number(const char *value, int least, int most, int *out) {
    char *end;
    long found = strtol(value, &end, 10);
    if (*value < '0' || *value > '9' || *end || found < least || found > most)
        return false;
    *out = (int)found;
    return true;
}

static bool set_one(const char *key, const char *value, struct settings *s) {
    if (strcmp(key, "bits") == 0)
        return number(value, 8, 28, &s->bits);
    if (strcmp(key, "roots") == 0)
        return (s->steps = word_of(value, ROOTS, 5)) >= 0;
    if (strcmp(key, "clear") == 0)
        return (int)(s->clear = (enum clear)word_of(value, CLEARS, 4)) >= 0;
    if (strcmp(key, "unit") != 0)
        return false;
    s->unit = -1;
    if (strcmp(value, "auto") == 0)
        return true;
    int unit;
    if (!number(value, 1, 1024, &unit) || (unit & (unit - 1)) != 0)
        return false;
    for (s->unit = 0; unit > 1 << s->unit;)
        s->unit++;
    return true;
}

bool settings_read(const char *text, struct settings *s, char *error) {
    *s = (struct settings){.bits = 20, .unit = 0, .steps = OWN_STEPS, .clear = OWN_CLEAR};
    while (text && *text) {
        char word[64];
        size_t length = strcspn(text, " ");
        const char *equals = memchr(text, '=', length);
        bool good = equals && length < sizeof word;
        if (good) {
            memcpy(word, text, length);
            word[length] = '\0';
            word[equals - text] = '\0';
            good = set_one(word, word + (equals - text) + 1, s);
        }
        if (!good) {
            snprintf(error, 512, "STEPWISE_FIXED: \"%.*s\": should be of %s",
                     (int)(length < 100 ? length : 100), text, FORM);
            return false;
        }
        text += length + (text[length] == ' ');
    }
    return true;
}

void format_say(const struct format *f, char *text) {
    snprintf(text, 128, "bits=%d unit=%d roots=%s clear=%s", f->bits, 1 << f->unit, ROOTS[f->steps],
             CLEARS[f->clear]);
}
