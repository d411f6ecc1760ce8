// A phase's settings as words "key=value", separated by one blank each, as an environment variable has them.
#pragma once

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct settings; // a phase's own

// Sets what one word says. Returns false if there is no such key or value.
typedef bool set_word(const char *key, const char *value, struct settings *settings);

// Sets what each word of `text` says; NULL: nothing. Returns false, with one line in `error` (512 bytes), at the first
// that says nothing: `name` is the variable's, `form` what words should be of.
static inline bool words_read(const char *text, const char *name, const char *form, set_word *set,
                              struct settings *settings, char *error) {
    while (text && *text) {
        char word[64] = "";
        size_t length = strcspn(text, " ");
        if (length < sizeof word)
            memcpy(word, text, length);
        char *equals = strchr(word, '=');
        if (equals)
            *equals = '\0';
        if (!equals || !set(word, equals + 1, settings)) {
            snprintf(error, 512, "%s: \"%.*s\": should be of %s", name,
                     length < 100 ? (int)length : 100, text, form);
            return false;
        }
        text += length + (text[length] == ' ');
    }
    return true;
}

// Reads a whole number from `least` to `most`.
static inline bool word_number(const char *value, int least, int most, int *out) {
    char *end;
    long found = strtol(value, &end, 10);
    if (*value < '0' || *value > '9' || *end || found < least || found > most)
        return false;
    *out = (int)found;
    return true;
}

// Finds the place of `value` among `count` words.
static inline bool word_among(const char *value, const char *const *words, int count, int *out) {
    for (*out = 0; *out < count; ++*out)
        if (strcmp(value, words[*out]) == 0)
            return true;
    return false;
}
