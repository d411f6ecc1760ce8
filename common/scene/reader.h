// Values of a scene's JSON, each checked: a mistake is answered with the path of the value that is wrong.
#ifndef STEPWISE_SCENE_READER_H
#define STEPWISE_SCENE_READER_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

// Far beyond any use, small enough that no float phase overflows when it squares a length twice.
static const double LARGEST = 1e9, SMALLEST = 1e-9;

struct reader {
    const char *file;
    char path[256];
    char *error;
    bool failed;
};

enum range { ANY, POSITIVE, NOT_NEGATIVE, CELL, ROUNDING, UNIT, FIELD_OF_VIEW };

// `FILE: $.path.key: what`, of the first fault alone; `key` is NULL where the path says all.
__attribute__((format(printf, 3, 4))) void reader_fail(struct reader *r, const char *key,
                                                       const char *format, ...);

// What a message repeats of the file cannot break its one line, nor steer a terminal.
void reader_one_line(char *message);

// Paths grow and shrink as the reader walks down and up; enter returns the length to go back to.
size_t reader_enter(struct reader *r, const char *key);
void reader_leave(struct reader *r, size_t length);

// What a value is, in words.
const char *reader_kind(const json_t *value);

// All but the last fail on what is missing, of another type or out of range, and return something usable then.
void reader_only_keys(struct reader *r, json_t *object, const char *const *known); // ends with NULL
json_t *reader_member(struct reader *r, json_t *object, const char *key, json_type type,
                      const char *wanted); // NULL: failed
double reader_number(struct reader *r, json_t *object, const char *key, enum range range);
int reader_whole(struct reader *r, json_t *object, const char *key, int lowest, int highest);
bool reader_vector(struct reader *r, json_t *object, const char *key, enum range range,
                   double out[3]);
void *reader_allocate(struct reader *r, size_t count, size_t size); // zeros; NULL: failed

#endif
