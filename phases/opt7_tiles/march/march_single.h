// Marches of rays that can hit one shape only: no shape sleeps or wakes, and the shape's type is known.
#pragma once

#include <stdbool.h>

struct march_state; // march/march_state.h
struct model;
struct packet_group;
struct prepared;

// Marches all packets of the group to the end, where the plane `shape` is the only shape that the rays can hit. `next`
// is the number of the first step.
void march_to_plane(struct march_state *packets, int shape, int next, struct packet_group *group,
                    const struct model *model);

// Marches all packets to the end, where the solid `shape` is the only shape that the rays can hit. Returns false, with
// nothing done, if there is no march for its type.
bool march_solid(struct march_state *packets, int shape, struct packet_group *group,
                 const struct prepared *scene);
