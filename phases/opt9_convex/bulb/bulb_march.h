// Camera and mirror rays to Mandelbulbs: queue, march and take the hits (bulb/bulb_march.c).
#pragma once

#include "simd/simd.h"
#include "types/known_scene.h"

struct packet_ray;
struct shading_packet;
struct tile_context;
struct worker_scratch;

// Queues the rays that meet the bounding sphere of s before `end`. o, d: origin and direction in its frame.
// slot: of the first lane in worker_scratch.met. Returns the new number of queued rays.
KERNEL_SHARED int queue_bulb_rays(int count, const struct primitive *s, struct vec_double o,
                                  struct vec_double d, const struct packet_ray *ray, vfloat end,
                                  int slot, const struct prepared *scene,
                                  struct worker_scratch *scratch);

// Marches the queued rays, and stores the hits in worker_scratch.met.
KERNEL_SHARED void march_bulb(const struct primitive *s, int count, const struct limits *limits,
                              struct worker_scratch *scratch);

// Takes the hits from slot on that are nearer than the packet's hits so far. clear_bulb_hits() removes all of
// them.
KERNEL_SHARED void take_bulb_hits(struct shading_packet *at, int slot,
                                  const struct worker_scratch *scratch);

KERNEL_SHARED void clear_bulb_hits(struct worker_scratch *scratch, int slots);

// Queues, marches and takes the hits of a group of packets of mirror rays.
KERNEL_SHARED void hit_bulbs(struct shading_packet *stage, int packets,
                             const struct tile_context *work);
