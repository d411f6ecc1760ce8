// The shadow rays that wait, by what the scene is: each kind of scene has a way of its own to march them.
#include "umbra.h"

void cast_shadows(const struct convex *work) {
    if (KNOWN(work->scene)->bulbs)
        cast_streams(work);
    else if (IS_CROWD(work->scene))
        cast_crowd(work);
    else
        cast_packets(work);
}
