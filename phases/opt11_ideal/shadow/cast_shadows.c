// All shadow rays take one way: no march, so no streams and no batches.
#include "shadow/shadow_rays.h"
#include "types/tile_context.h"

void cast_shadows(const struct tile_context *work) {
    cast_packets(work);
}
