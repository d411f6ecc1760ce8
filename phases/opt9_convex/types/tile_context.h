// Sizes of tiles and queues, a worker's scratch memory, and the context of a tile.
#pragma once

#include <string.h>

#include "simd/simd.h"
#include "types/known_scene.h"

#include "core/pixel_block.h" // needs simd.h

enum {
    TILE_WIDTH = 32,
    TILE_HEIGHT = 8,
    BULB_TILE_HEIGHT =
        128, // taller: a ray to a Mandelbulb may take 1,000 steps, while others fill the lanes
    TILE_PIXELS = TILE_WIDTH * BULB_TILE_HEIGHT, // at most
    COLOR_ROOM = TILE_PIXELS + 3 * LANES, // avoids 4 KiB aliasing between a pixel's three colours
    GROUP = TILE_WIDTH / BLOCK_WIDTH,     // packets that are shaded together
    BLOCKS_ACROSS = GROUP,
    BLOCKS_DOWN = TILE_HEIGHT / BLOCK_HEIGHT,
    BLOCKS = BLOCKS_ACROSS * BLOCKS_DOWN,
    QUEUE = 5120, // rays; a full queue is emptied at once
    QUEUE_ROOM = QUEUE + 2 * LANES
};

// Packets marched in turns with a Mandelbulb. Shadow rays: as many in work, as many that leave, and one that
// is ready.
enum { INTERLEAVED = 3, REFILLED_PACKETS = 2 * INTERLEAVED + 1 };

// Fields of a queued mirror ray. Its pixel gets `weight` times the colour that it sees.
enum mirror_field {
    M_ORIGIN,
    M_DIRECTION = 3,
    M_WEIGHT = 6,
    M_PIXEL,
    M_BOUNCE,
    M_LEAVES, // the shape on which it starts
    M_LOCAL,  // scenes with repeated shapes: its start in that shape's frame
    M_FIELDS = M_LOCAL + 3
};

// Fields of a queued shadow ray. Its pixel gets `light` times the shadow's value.
enum shadow_field {
    S_POINT,
    S_LOCAL = 3, // the point in the frame of its shape
    S_TO_LIGHT = 6,
    S_LIGHT = 9,
    S_FACING = 12,
    S_LIT = S_FACING, // with a BVH: the shadow's value, once the ray has been marched
    S_SHAPE,
    S_PIXEL,
    S_FIELDS
};

// Fields of a queued ray through a Mandelbulb's bounding sphere, in its frame. The ray's origin is replaced
// by its nearest point to the centre, which lies `before` ahead of the true origin.
enum bulb_field {
    B_ORIGIN,
    B_DIRECTION = 3,
    B_T = 6, // distance from that point, as two floats; ends at `to`
    B_T_LOW,
    B_TO,
    B_BEFORE,
    B_HEIGHT,
    B_SLOPE,
    B_SLOT,
    B_RAY,   // its index in worker_scratch.bulb
    B_STEPS, // lane: the step count at its start; queued ray: steps taken
    B_LANE,
    B_LOW = B_LANE, // low parts of origin and direction
    B_FIELDS = B_LOW + 6
};

// Fields of a ray that waits for its next piece (bulb/bulb_chebyshev.c). t is two floats; HAD: steps taken.
enum close_ray_field { C_RAY, C_T, C_T_LOW, C_HAD, C_FIELDS };

enum { BULB_ROOM = TILE_PIXELS + LANES, CLOSE_ROOM = 2 * TILE_PIXELS + 2 * LANES };

enum { BATCH_CANDIDATES_ROOM = 256 }; // solids

struct shadow_candidate;

// A worker's memory. frame/worker_scratch.h lays out the arrays that the pointers name.
struct worker_scratch {
    float color[3 * COLOR_ROOM]; // red, green and blue of the tile, block after block
    float mirror[M_FIELDS][QUEUE_ROOM], shadow[S_FIELDS][QUEUE_ROOM];
    float bulb[B_FIELDS][BULB_ROOM];
    // Rays that wait for the march by polynomials (close) and for the march in floats (open):
    // bulb/bulb_chebyshev.c.
    float close[C_FIELDS][CLOSE_ROOM], open[B_LANE][BULB_ROOM];
    int close_first, close_count, open_count;
    // Hits on Mandelbulbs: distance (infinite: none), shape, and point in its frame.
    float met[TILE_PIXELS], met_shape[TILE_PIXELS], met_at[3][TILE_PIXELS];
    float shape;                              // the Mandelbulb that is marched to
    int mirrors, shadows;                     // lengths of the queues
    struct shadow_candidate *candidates;      // per packet of shadow rays in work, one per shape
    struct shape_set camera_shapes;           // shapes that the tile's camera rays may meet
    int *row_list, row_counts[GROUP];         // with a BVH: the same for each block of a row
    struct shape_set occluders;               // shapes that can darken the group of packets in work
    struct shape_set listed[PACKETS_IN_WORK]; // shapes that can darken a packet of shadow rays
    int *mirror_list;         // with a BVH: shapes that a packet of mirror rays may meet
    int *active_list;         // with a BVH: the active set of a batch of shadow rays
    int *entry_list, entries; // with a BVH: solids that a packet of shadow rays may enter
    int batch_count;          // solids that a batch may enter; −1: more than there is room for
    int batch_shape[BATCH_CANDIDATES_ROOM];
    float batch_sphere[4][BATCH_CANDIDATES_ROOM]; // their bounding spheres: x, y, z, radius
    // The BVH leaf that blocked the last ray, tested first in the next query: before a march (leaf) and
    // during one (far). −1: none yet.
    int leaf, far;
    unsigned long long marks[SCENE_MAX_SHAPES / 64];       // a set of shapes, a bit for each
    unsigned short order[2][QUEUE_ROOM], code[QUEUE_ROOM]; // sort keys of the queued shadow rays
};

// Empties the queues. The memory may hold anything before.
static inline void reset_scratch(struct worker_scratch *scratch) {
    scratch->mirrors = scratch->shadows = 0;
    scratch->close_count = scratch->close_first = scratch->open_count = 0;
    memset(scratch->marks, 0, sizeof scratch->marks);
}

// What the functions of a tile share: the frame's constants and the worker's memory.
struct tile_context {
    const struct prepared *scene;
    const struct view *view;
    struct worker_scratch *scratch;
    float light[3], emission[3]; // the view's, rounded to float once
    float light_from_eye[3];     // light position minus camera position
    float inside;                // up to this t, a camera ray is within the bounds
};

static inline float float_max(float a, float b) { // fmaxf is a call
    return a > b ? a : b;
}

// Loads three fields of queued rays, from ray `first` on; and stores those of the lanes in m one behind the
// other.
static inline struct vec load_vec(float field[][QUEUE_ROOM], int first) {
    return (struct vec){v_load(&field[0][first]), v_load(&field[1][first]),
                        v_load(&field[2][first])};
}

static inline void pack_vec(vmask m, struct vec v, float field[][QUEUE_ROOM], int first) {
    v_compress_store(m, v.x, &field[0][first]);
    v_compress_store(m, v.y, &field[1][first]);
    v_compress_store(m, v.z, &field[2][first]);
}

// Adds light to the pixels of the lanes in m, one after the other where lanes may share a pixel. If m is empty,
// `pixel` may hold an older ray's pixels or zeros, which are still valid addresses.
static inline void add_light(vmask m, struct vec light, vfloat pixel,
                             struct worker_scratch *scratch) {
    float *first = &scratch->color[(int)v_lane0(pixel)];
    vmask apart = v_cmp_gt(v_abs(pixel - v_splat(v_lane0(pixel)) - v_iota()), v_splat(0.5f));
    if (!v_any(v_and(m, apart))) { // neighbours, as most are
        v_store(v_load(first) + v_select_or_zero(m, light.x), first);
        v_store(v_load(first + COLOR_ROOM) + v_select_or_zero(m, light.y), first + COLOR_ROOM);
        v_store(v_load(first + 2 * COLOR_ROOM) + v_select_or_zero(m, light.z),
                first + 2 * COLOR_ROOM);
        return;
    }
    float red[LANES], green[LANES], blue[LANES], at[LANES];
    v_store(light.x, red);
    v_store(light.y, green);
    v_store(light.z, blue);
    v_store(pixel, at);
    for (unsigned rest = v_mask_bits(m); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), i = (int)at[lane];
        scratch->color[i] += red[lane];
        scratch->color[COLOR_ROOM + i] += green[lane];
        scratch->color[2 * COLOR_ROOM + i] += blue[lane];
    }
}

INLINE vmask is_shape(vfloat shape, int i) {
    return v_cmp_lt(v_abs(shape - v_splat((float)i)), v_splat(0.5f));
}

static inline float lane_of(vfloat a, int lane) {
    float lanes[LANES];
    v_store(a, lanes);
    return lanes[lane];
}

// A loop over the shapes that the lanes of a mask hit. left: the lanes whose shape has not been visited. An
// unrolled loop visits every shape, whether a lane hit it or not.
static inline bool hits_left(unsigned left, int k) {
    return UNROLLED_SHAPES ? k < UNROLLED_SHAPES : left != 0;
}

static inline int next_hit_shape(unsigned *left, vfloat shape, int k) {
    if (UNROLLED_SHAPES)
        return k;
    int i = (int)lane_of(shape, __builtin_ctz(*left));
    *left &= ~v_mask_bits(is_shape(shape, i));
    return i;
}
