#include "viewer/viewer.h"
int window_run(const struct viewer_options *options, struct show *show) {
    (void)options;
    (void)show;
    return 0;
}
