// Chooses how the queued shadow rays are marched: in streams, in batches or packet by packet.
#include "shadow/shadow_rays.h"
#include "types/tile_context.h"

void cast_shadows(const struct tile_context *work) {
    if (KNOWN(work->scene)->bulbs)
        cast_streams(work);
    else if (HAS_BVH(work->scene))
        cast_batches(work);
    else
        cast_packets(work);
}
