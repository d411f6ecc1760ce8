// The ideal soft shadow of a group of packets.
#pragma once

#include "simd/simd.h"

struct packet_group; // core/packet_group.h
struct prepared;     // core/primitive.h

// Sets how much of the light reaches each hit, from 0 to 1. The group's packets are ready to march. `distance` is the
// light's.
void ideal_shadow(const vfloat *distance, struct packet_group *group, const struct prepared *scene,
                  vfloat *reach);
