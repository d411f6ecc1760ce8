// STEPWISE_FIXED: words like "clear=safe", parted by one space.
#include <stdio.h>
#include <string.h>

#include "format.h"
#include "own.h"

static const char *const FORM = "clear=corners|safe|lists|never";
static const char *const CLEARS[] = {"corners", "safe", "lists", "never"};

// Which of the words it is; −1: none.
static int word_of(const char *value, const char *const *words, int count) {
    for (int i = 0; i < count; i++)
        if (strcmp(value, words[i]) == 0)
            return i;
    return -1;
}

static bool set_one(const char *key, const char *value, struct settings *s) {
    return strcmp(key, "clear") == 0 &&
           (int)(s->clear = (enum clear)word_of(value, CLEARS, 4)) >= 0;
}

bool settings_read(const char *text, struct settings *s, char *error) {
    *s = (struct settings){.clear = OWN_CLEAR};
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
    snprintf(text, 128, "clear=%s", CLEARS[f->clear]);
}
