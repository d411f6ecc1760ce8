// The settings of the fixed-point format: bits of fraction, unit of length, Newton steps of the roots.
#include "number/format.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "scene/words.h"

enum { ROOT_KINDS = 5, LARGEST_UNIT = 1024 };

const char SETTINGS_FORM[] =
    "bits=8..28 unit=1|2|4|…|1024|auto roots=article|1|2|3|4 clear=corners|safe|lists|never";

static const char *const ROOTS[ROOT_KINDS] = {"article", "1", "2", "3", "4"}; // by Newton steps

// unit=auto, or a power of two.
static bool set_unit(const char *value, struct settings *s) {
    s->unit = -1;
    if (strcmp(value, "auto") == 0)
        return true;
    int unit;
    if (!word_number(value, 1, LARGEST_UNIT, &unit) || (unit & (unit - 1)) != 0)
        return false;
    for (s->unit = 0; unit > 1 << s->unit;)
        s->unit++;
    return true;
}

bool format_set(const char *key, const char *value, struct settings *s) {
    if (strcmp(key, "bits") == 0)
        return word_number(value, 8, 28, &s->bits);
    if (strcmp(key, "unit") == 0)
        return set_unit(value, s);
    return strcmp(key, "roots") == 0 && word_among(value, ROOTS, ROOT_KINDS, &s->newton_steps);
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
