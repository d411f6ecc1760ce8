// Reads and checks values of a scene's JSON. See reader.h.
#include "scene/reader.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene/scene.h"

void reader_one_line(char *message) {
    for (char *c = message; *c; c++)
        if ((unsigned char)*c < ' ' || *c == 0x7f)
            *c = '?';
}

void reader_fail(struct reader *r, const char *key, const char *format, ...) {
    if (r->failed)
        return; // only the first error is reported
    r->failed = true;
    int used = snprintf(r->error, SCENE_ERROR_SIZE, "%s: %s%s%s: ", r->file, r->path,
                        key && key[0] != '[' ? "." : "", key ? key : "");
    if (used >= 0 && used < SCENE_ERROR_SIZE) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(r->error + used, (size_t)(SCENE_ERROR_SIZE - used), format, arguments);
        va_end(arguments);
    }
    reader_one_line(r->error);
}

size_t reader_enter(struct reader *r, const char *key) {
    size_t length = strlen(r->path);
    snprintf(r->path + length, sizeof r->path - length, "%s%.80s", key[0] == '[' ? "" : ".", key);
    return length;
}

void reader_leave(struct reader *r, size_t length) {
    r->path[length] = '\0';
}

const char *reader_kind(const json_t *value) {
    switch (json_typeof(value)) {
    case JSON_OBJECT: return "an object";
    case JSON_ARRAY: return "an array";
    case JSON_STRING: return "a string";
    case JSON_INTEGER:
    case JSON_REAL: return "a number";
    case JSON_TRUE:
    case JSON_FALSE: return "a boolean";
    default: return "null";
    }
}

void reader_only_keys(struct reader *r, json_t *object, const char *const *known) {
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value) {
        bool found = false;
        for (const char *const *k = known; *k; k++)
            found = found || strcmp(*k, key) == 0;
        if (!found) {
            char list[512] = "";
            for (const char *const *k = known; *k; k++) {
                size_t used = strlen(list);
                snprintf(list + used, sizeof list - used, "%s%s", used ? ", " : "", *k);
            }
            char quoted[96];
            snprintf(quoted, sizeof quoted, "%.80s", key);
            reader_fail(r, quoted, "unknown key; known here: %s", list);
            return;
        }
    }
}

// Returns the member, or NULL after an error.
static json_t *present(struct reader *r, json_t *object, const char *key, const char *wanted) {
    json_t *value = json_object_get(object, key);
    if (!value)
        reader_fail(r, key, "missing; %s is required", wanted);
    return value;
}

json_t *reader_member(struct reader *r, json_t *object, const char *key, json_type type,
                      const char *wanted) {
    json_t *value = present(r, object, key, wanted);
    if (value && json_typeof(value) != type) {
        reader_fail(r, key, "%s where %s is required", reader_kind(value), wanted);
        value = NULL;
    }
    return value;
}

// Returns the number, after checking that it is one and in range.
static double checked(struct reader *r, const char *key, json_t *value, enum range range) {
    if (!json_is_number(value)) {
        reader_fail(r, key, "%s where a number is required", reader_kind(value));
        return 1;
    }
    double x = json_number_value(value) + 0.0; // −0 is 0, as in the hash
    if (!isfinite(x))
        reader_fail(r, key, "not a finite number");
    else if (range == POSITIVE && !(x > 0))
        reader_fail(r, key, "%g is not > 0", x);
    else if (range == POSITIVE && x < SMALLEST)
        reader_fail(r, key, "%g is under %g, the smallest length there is", x, SMALLEST);
    else if ((range == NOT_NEGATIVE || range == CELL || range == ROUNDING) && !(x >= 0))
        reader_fail(r, key, "%g is not >= 0", x);
    else if (range == CELL && !(x == 0 || x >= SMALLEST))
        reader_fail(r, key, "%g is neither 0 nor a cell of at least %g", x, SMALLEST);
    else if (range == ROUNDING && !(x == 0 || x >= SMALLEST))
        reader_fail(r, key, "%g is neither 0 nor a length of at least %g", x, SMALLEST);
    else if (range == UNIT && !(x >= 0 && x <= 1))
        reader_fail(r, key, "%g is not in 0 to 1", x);
    else if (range == FIELD_OF_VIEW && !(x >= 1 && x <= 170))
        reader_fail(r, key, "%g is not in 1 to 170 degrees", x);
    else if (!(fabs(x) <= LARGEST))
        reader_fail(r, key, "%g is beyond %g, the largest number there is", x, LARGEST);
    return x;
}

double reader_number(struct reader *r, json_t *object, const char *key, enum range range) {
    json_t *value = present(r, object, key, "a number");
    return value ? checked(r, key, value, range) : 1;
}

int reader_whole(struct reader *r, json_t *object, const char *key, int lowest, int highest) {
    json_t *value = present(r, object, key, "a whole number");
    if (!value)
        return lowest;
    if (!json_is_number(value)) {
        reader_fail(r, key, "%s where a whole number is required", reader_kind(value));
        return lowest;
    }
    double x = json_number_value(value);
    if (!(x == floor(x)))
        reader_fail(r, key, "%g is not a whole number", x);
    else if (!(x >= lowest))
        reader_fail(r, key, "%g is not >= %d", x, lowest);
    else if (!(x <= highest))
        reader_fail(r, key, "%g is beyond %d, the largest there is", x, highest);
    else
        return (int)x;
    return lowest;
}

bool reader_vector(struct reader *r, json_t *object, const char *key, enum range range,
                   double out[3]) {
    json_t *value = json_object_get(object, key);
    if (!value)
        reader_fail(r, key, "missing; three numbers are required");
    if (!value || !json_is_array(value) || json_array_size(value) != 3) {
        if (value && json_is_array(value))
            reader_fail(r, key, "%zu numbers where exactly 3 are required", json_array_size(value));
        else if (value)
            reader_fail(r, key, "%s where an array of 3 numbers is required", reader_kind(value));
        return false;
    }
    size_t back = reader_enter(r, key);
    for (int i = 0; i < 3; i++) {
        char index[8];
        snprintf(index, sizeof index, "[%d]", i);
        out[i] = checked(r, index, json_array_get(value, (size_t)i), range);
    }
    reader_leave(r, back);
    return !r->failed;
}

void *reader_allocate(struct reader *r, size_t count, size_t size) {
    void *memory = calloc(count ? count : 1, size);
    if (!memory)
        reader_fail(r, NULL, "out of memory");
    return memory;
}
