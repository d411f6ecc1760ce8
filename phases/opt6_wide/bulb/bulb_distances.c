#include "core/sdf.h"
#include "core/shape_distances.h"

#include "bulb/bulb_group.h"

void bulb_distances(struct packet_group *group, int shape, const struct primitive *primitive,
                    struct nearest_so_far *found) {
    whole_bulb_distances(group, shape, primitive, found);
}
