// Reads values from a scene's JSON and checks each. An error names the path of the wrong value.
#pragma once

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

// LARGEST is far beyond any use, and small enough that a float phase can square a length twice.
static const double LARGEST = 1e9, SMALLEST = 1e-9;

struct reader {
    const char *file;
    char path[512]; // of the current object, e.g. $.shapes[3]
    char *error;    // at least SCENE_ERROR_SIZE bytes
    bool failed;
};

enum range { ANY, POSITIVE, NOT_NEGATIVE, CELL, ROUNDING, UNIT, FIELD_OF_VIEW };

// Writes `FILE: $.path.key: message` to the reader's error and sets `failed`. Only the first error
// is kept. `key` is NULL if the error is in the object at the current path itself.
__attribute__((format(printf, 3, 4))) void reader_fail(struct reader *r, const char *key,
                                                       const char *format, ...);

// Replaces control characters by '?'. Text quoted from the file then cannot break the message's
// line or control the terminal.
void reader_one_line(char *message);

// Appends a key or an index in brackets to the path. Returns the old length, for reader_leave.
size_t reader_enter(struct reader *r, const char *key);
void reader_leave(struct reader *r, size_t length);

// Returns the JSON type of a value in words, e.g. "an array".
const char *reader_kind(const json_t *value);

// The functions below report an error to `r` if the value is missing, has another type or is out of
// range. After an error they return a value that is safe to compute with.

// Checks that the object has no other keys than `known`, which ends with NULL.
void reader_only_keys(struct reader *r, json_t *object, const char *const *known);
// Returns the member `key`, or NULL after an error. `wanted`: the type in words.
json_t *reader_member(struct reader *r, json_t *object, const char *key, json_type type,
                      const char *wanted);
double reader_number(struct reader *r, json_t *object, const char *key, enum range range);
int reader_whole(struct reader *r, json_t *object, const char *key, int lowest, int highest);
// Reads three numbers. Returns false after an error.
bool reader_vector(struct reader *r, json_t *object, const char *key, enum range range,
                   double out[3]);

// Returns zeroed memory for `count` elements, or NULL after reporting that memory is short.
void *reader_allocate(struct reader *r, size_t count, size_t size);
