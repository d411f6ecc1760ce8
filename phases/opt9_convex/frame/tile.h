// A tile, its blocks of pixels and their camera rays, and how colours reach the picture.
#pragma once

#include "types/shading_packet.h"
#include "types/tile_context.h"

// A tile, in pixels, and what the camera rays of its blocks share.
struct tile {
    int left, right, top, bottom;
    struct vec eye, ahead, across, up;
    vfloat below, beside; // of each lane in its block, in pixels
    float per_height;     // half a pixel in the picture's plane at distance 1
};

// Returns block i of the row of blocks that begins at pixel row `row`.
static inline struct pixel_block block_at(const struct tile *tile, int row, int i) {
    int column = tile->left + i * BLOCK_WIDTH;
    return (struct pixel_block){column, row, int_min(BLOCK_WIDTH, tile->right - column),
                                int_min(BLOCK_HEIGHT, tile->bottom - row)};
}

// Sets a packet of camera rays. slot: of its first lane in worker_scratch.color.
static inline void set_camera_ray(const struct tile *tile, struct vec direction, vmask active,
                                  int slot, struct packet_ray *ray) {
    vfloat zero = v_splat(0.0f);
    ray->origin = tile->eye;
    ray->direction = direction;
    ray->weight = v_splat(1.0f);
    ray->pixel = v_iota() + v_splat((float)slot);
    ray->bounce = zero;
    ray->leaves = v_splat(-1.0f);
    ray->active = active;
    ray->local = (struct vec){zero, zero, zero};
}

// frame/store_pixels.c: a block's colours, its other channels, its colours from worker_scratch.color; whole rows
// of a tile, if is_whole_lines(); a tile of background.
KERNEL_SHARED void store_block(struct frame *frame, struct pixel_block block, struct vec color);
KERNEL_SHARED void store_hit(struct frame *frame, struct pixel_block block,
                             const struct surface_hit *hit, struct vec normal);
KERNEL_SHARED void store_colors(struct frame *frame, struct pixel_block block, const float *color);
KERNEL_SHARED bool is_whole_lines(int left, int right, int top, int bottom);
KERNEL_SHARED void store_rows(struct frame *frame, int left, int right, int top, int bottom,
                              const float *color);
KERNEL_SHARED void fill_background(struct frame *frame, int left, int right, int top, int bottom,
                                   const struct known_model *model);

// frame/camera_rays.c: the hits of a whole tile in a scene with repeated shapes; the hits of a tile on
// Mandelbulbs, to worker_scratch.met; and a row of packets with their hits, whose number is returned.
KERNEL_SHARED void repeated_tile(const struct tile *tile, const struct job *job,
                                 const struct worker_scratch *scratch, struct primary_hit *hits);
KERNEL_SHARED void march_tile_bulbs(const struct tile *tile, const struct job *job,
                                    struct worker_scratch *scratch);
KERNEL_SHARED int camera_row(const struct tile *tile, int row, int pixel,
                             const struct primary_hit *hits, const struct job *job,
                             struct worker_scratch *scratch, struct shading_packet *stage);

// Sets hit.local to the normals of hits on shapes that are not repeated.
KERNEL_SHARED void primary_normals(struct primary_hit *seen, const struct prepared *scene);

// Sets at->color from the hits. Precondition: needs_no_secondary().
KERNEL_SHARED void shade_primary_hit(const struct primary_hit *seen, struct shading_packet *at,
                                     const struct tile_context *work);

// Sets the colours of packets whose hits are known. Light that depends on a march, and mirror rays, are queued.
KERNEL_SHARED void shade_packets(struct shading_packet *stage, int count,
                                 const struct tile_context *work);

// Returns the number of analytic tiles of a frame, and draws one (frame/analytic_tile.c).
KERNEL_SHARED int count_tiles(const struct job *job);

KERNEL_SHARED void draw_analytic_tile(const struct job *job, int tile,
                                      struct worker_scratch *scratch);
