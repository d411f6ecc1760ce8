// All shadow rays take one way: no march, so no streams and no batches.
#include "core/tile_context.h"
#include "shadow/shadow_rays.h"

void cast_shadows(const struct tile_context *work) {
    cast_packets(work);
}
