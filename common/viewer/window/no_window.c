// In place of the window where SDL2 is missing.
#include "viewer/viewer.h"

int window_run(const struct viewer_options *options, struct show *show) {
    (void)options;
    (void)show;
    return viewer_error(BAD_INPUT, "built without SDL2, so that only --headless works; install "
                                   "libsdl2-dev, then make build/viewer");
}
