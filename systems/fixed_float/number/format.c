// The format of floats: there is nothing to set, and every scene fits.
#include "number/format.h"

const char SETTINGS_FORM[] = "clear=corners|safe|lists|never";

bool format_set(const char *key, const char *value, struct settings *settings) {
    (void)key, (void)value, (void)settings;
    return false;
}

void format_say(const struct format *f, char *text, size_t size) {
    (void)f, (void)size;
    text[0] = '\0';
}

struct format format_make(const struct settings *settings, int unit) {
    (void)unit;
    return (struct format){.clear = settings->clear, .scale = 1, .length_scale = 1};
}

bool format_fit(const struct settings *settings, const struct model *model, const struct view *view,
                struct format *f, char error[512]) {
    (void)model, (void)view, (void)error;
    *f = format_make(settings, 0);
    return true;
}

bool directions_fit(const struct format *f, const struct view *view, double aspect,
                    char error[512]) {
    (void)f, (void)view, (void)aspect, (void)error;
    return true;
}
