// The settings of the fixed-point format: bits of fraction, unit of length, Newton steps of the roots.
#include "number/format.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ROOT_KINDS = 5, LARGEST_UNIT = 1024 };

const char FORMAT_USAGE[] = "bits=8..28 unit=1|2|4|…|1024|auto roots=article|1|2|3|4 ";

static const char *const ROOTS[ROOT_KINDS] = {"article", "1", "2", "3", "4"}; // by Newton steps

static bool whole_number(const char *value, int least, int most, int *out) {
    char *end;
    long found = strtol(value, &end, 10);
    if (*value < '0' || *value > '9' || *end || found < least || found > most)
        return false;
    *out = (int)found;
    return true;
}

// unit=auto, or a power of two.
static bool set_unit(const char *value, struct settings *s) {
    s->unit = -1;
    if (strcmp(value, "auto") == 0)
        return true;
    int unit;
    if (!whole_number(value, 1, LARGEST_UNIT, &unit) || (unit & (unit - 1)) != 0)
        return false;
    for (s->unit = 0; unit > 1 << s->unit;)
        s->unit++;
    return true;
}

bool format_set(const char *key, const char *value, struct settings *s) {
    if (strcmp(key, "bits") == 0)
        return whole_number(value, 8, 28, &s->bits);
    if (strcmp(key, "unit") == 0)
        return set_unit(value, s);
    for (int i = 0; i < ROOT_KINDS && strcmp(key, "roots") == 0; i++)
        if (strcmp(value, ROOTS[i]) == 0) {
            s->newton_steps = i;
            return true;
        }
    return false;
}

void format_say(const struct format *f, char *text, size_t size) {
    snprintf(text, size, "bits=%d unit=%d roots=%s ", f->bits, 1 << f->unit,
             ROOTS[f->newton_steps]);
}

struct format format_make(const struct settings *s, int unit) {
    return (struct format){.bits = s->bits,
                           .unit = unit,
                           .newton_steps = s->newton_steps,
                           .clear = s->clear,
                           .scale = ldexp(1, -s->bits),
                           .length_scale = ldexp(1, unit - s->bits)};
}
