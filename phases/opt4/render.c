// The phase's entry points (common/phase.h) and its loop over pixels: eight neighbours of a row at a
// time, one ray through the centre of each. A mask cuts the last packet of a row to the width.
#include "phase.h"
#include "trace.h"

#include "scene/prepare_once.h" // needs trace.h

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    COUNT(phase_render, call);
    struct world world = {prepared, view, new_local_rays(prepared)};
    if (!world.local_rays)
        return false;
    struct point origin = point_from_doubles(view->position);
    for (int row = 0; row < frame->height; row++) {
        for (int column = 0; column < frame->width; column += LANES) {
            int count = frame->width - column < LANES ? frame->width - column : LANES;
            ACTIVE(count);
            COUNT(phase_render, packet);
            struct shaded seen;
            trace(origin, get_direction(column, row, frame, view), v_mask_first(count), 0, &world,
                  &seen);
            ACTIVE(count);
            store(frame, (size_t)row * (size_t)frame->width + (size_t)column, count, &seen);
        }
    }
    free(world.local_rays);
    return true;
}
