// Camera and mirror rays through a Mandelbulb: queued, marched, and their hits taken.
#ifndef OPT9_BULB_MARCH_H
#define OPT9_BULB_MARCH_H

#include "core/known_scene.h"
#include "simd/point.h"

struct packet_ray;
struct shading_packet;
struct tile_context;
struct worker_scratch;

// Rays through a Mandelbulb's bounding sphere that wait for march_bulb(); returns how many there are now. o, d:
// in its frame; slot: where the first lane's answer is to be.
KERNEL_SHARED int queue_bulb_rays(int count, const struct primitive *s, struct vec_double o,
                                  struct vec_double d, const struct packet_ray *ray, vfloat end,
                                  int slot, const struct prepared *scene,
                                  struct worker_scratch *scratch);

// Mandelbulb: where the group's rays that wait on the desk meet it.
KERNEL_SHARED void march_bulb(const struct primitive *s, int count, const struct limits *limits,
                              struct worker_scratch *scratch);

// The answers: what the packet meets there, if before what it has met so far.
KERNEL_SHARED void take_bulb_hits(struct shading_packet *at, int slot,
                                  const struct worker_scratch *scratch);

KERNEL_SHARED void clear_bulb_hits(struct worker_scratch *scratch, int slots);

// All of it for a group of mirror rays.
KERNEL_SHARED void hit_bulbs(struct shading_packet *stage, int packets,
                             const struct tile_context *work);

#endif
