// What a worker keeps for a tile: sizes, queues of rays, lists of shapes; and the frame's constants.
#ifndef OPT9_TILE_CONTEXT_H
#define OPT9_TILE_CONTEXT_H

#include <string.h>

#include "core/known_scene.h"
#include "simd/permute.h"
#include "simd/vec.h"

enum {
    TILE_WIDTH = 32,
    TILE_HEIGHT = 8,
    BULB_TILE_HEIGHT =
        128, // some rays to a Mandelbulb take 1,000 steps: many others must share the wait
    BLOCK_WIDTH = 4,
    BLOCK_HEIGHT = LANES / BLOCK_WIDTH,
    TILE_PIXELS = TILE_WIDTH * BULB_TILE_HEIGHT, // at most
    COLOR_ROOM = TILE_PIXELS + 3 * LANES, // so that no two of a pixel's colours are 4 KiB apart
    GROUP = TILE_WIDTH / BLOCK_WIDTH,     // packets that are shaded together
    BLOCKS_ACROSS = GROUP,
    BLOCKS_DOWN = TILE_HEIGHT / BLOCK_HEIGHT,
    BLOCKS = BLOCKS_ACROSS * BLOCKS_DOWN,
    QUEUE = 5120, // rays; a full one is worked off
    QUEUE_ROOM = QUEUE + 2 * LANES
};

enum {
    INTERLEAVED = 3,
    REFILLED_PACKETS = 2 * INTERLEAVED + 1
}; // packets; of shadow rays: in work, on their way out, the next

// Mirror rays that wait: what they add to their pixel is `weight` times what they see.
enum mirror_field {
    M_ORIGIN,
    M_DIRECTION = 3,
    M_WEIGHT = 6,
    M_PIXEL,
    M_BOUNCE,
    M_LEAVES, // the shape it is from
    M_LOCAL,  // where shapes are repeated: the point it is from, in that one's frame
    M_FIELDS = M_LOCAL + 3
};

// Shadow rays that wait: `light` is what they add to their pixel where nothing is in the way.
enum shadow_field {
    S_POINT,
    S_LOCAL = 3, // the point in the frame of the shape it is on
    S_TO_LIGHT = 6,
    S_LIGHT = 9,
    S_FACING = 12,
    S_LIT = S_FACING, // of a crowd's, once it has been marched
    S_SHAPE,
    S_PIXEL,
    S_FIELDS
};

// Rays through a Mandelbulb's bounding sphere, in its frame, from where they are nearest to its centre: `before`
// from their origin.
enum bulb_field {
    B_ORIGIN,
    B_DIRECTION = 3,
    B_T = 6, // from there, as two floats; until `to`
    B_T_LOW,
    B_TO,
    B_BEFORE,
    B_HEIGHT,
    B_SLOPE,
    B_SLOT,
    B_RAY,  // its place on the desk
    B_BORN, // of a lane: in steps of all; of a ray: how many it has had
    B_LANE,
    B_LOW = B_LANE, // what origin and direction are more, as doubles
    B_FIELDS = B_LOW + 6
};

// Of those that wait to go on in bulb/bulb_chebyshev.h: t as two floats.
enum close_ray_field { C_RAY, C_T, C_T_LOW, C_HAD, C_FIELDS };

enum { BULB_ROOM = TILE_PIXELS + LANES, CLOSE_ROOM = 2 * TILE_PIXELS + 2 * LANES };

enum { BATCH_CANDIDATES_ROOM = 256 };

struct shadow_candidate;

// A worker's own.
struct worker_scratch {
    float color[3 * COLOR_ROOM]; // blocks one behind the other, their lanes in a row
    float mirror[M_FIELDS][QUEUE_ROOM], shadow[S_FIELDS][QUEUE_ROOM];
    float bulb[B_FIELDS][BULB_ROOM];
    float close[C_FIELDS][CLOSE_ROOM],
        open[B_LANE][BULB_ROOM]; // rays of these, see bulb/bulb_chebyshev.h
    int close_first, close_count, open_count;
    float met[TILE_PIXELS],
        met_shape[TILE_PIXELS], // where rays meet a Mandelbulb, ∞: nowhere, and which
        met_at[3][TILE_PIXELS]; // in its frame
    float shape;                // the Mandelbulb in work
    int mirrors, shadows;
    struct shadow_candidate
        *candidates; // of the packets of shadow rays in work, one per shape and packet
    struct shape_set camera_shapes;   // those that the tile's camera rays may meet
    int *row_list, row_counts[GROUP]; // of a crowd: of those what each block of a row may meet
    struct shape_set occluders;       // those that can matter to the light on the group in work
    struct shape_set listed[PACKETS_IN_WORK]; // those that a packet may meet
    // Of crowds: shapes that a packet of mirror rays may meet, and that are about one of shadow rays.
    int *mirror_list, *active_list;
    int *entry_list, entries; // solids that the packet of shadow rays in work may meet
    // Those that the batch's may, their spheres; −1: more than there is room for.
    int batch_count, batch_shape[BATCH_CANDIDATES_ROOM];
    float batch_sphere[4][BATCH_CANDIDATES_ROOM];
    // Of the tree's leaves: what was in a shadow ray's way the last time, of those asked before and in their march; −1:
    // nothing yet.
    int leaf, far;
    unsigned long long marks[SCENE_MAX_SHAPES / 64]; // a list in the making
    unsigned short order[2][QUEUE_ROOM],
        code[QUEUE_ROOM]; // of the shadow rays that wait: by solid, of planes by place
};

// Nothing waits on it. Whatever was in its memory.
static inline void reset_scratch(struct worker_scratch *scratch) {
    scratch->mirrors = scratch->shadows = 0;
    scratch->close_count = scratch->close_first = scratch->open_count = 0;
    memset(scratch->marks, 0, sizeof scratch->marks);
}

struct tile_context {
    const struct prepared *scene;
    const struct view *view;
    struct worker_scratch *scratch;
    float light[3], emission[3]; // the view's, as floats: not once more for each packet
    float light_from_eye[3];     // the light from the camera
    float inside;                // nearer than this a camera ray is within the bounds
};

KERNEL_SHARED int count_tiles(const struct job *job);

KERNEL_SHARED void draw_analytic_tile(const struct job *job, int tile,
                                      struct worker_scratch *scratch);

static inline int int_min(int a, int b) {
    return a < b ? a : b;
}

static inline float float_max(float a, float b) { // fmaxf is a call
    return a > b ? a : b;
}

static inline struct vec load_vec(float field[][QUEUE_ROOM], int first) {
    return (struct vec){v_load(&field[0][first]), v_load(&field[1][first]),
                        v_load(&field[2][first])};
}

static inline void pack_vec(vmask m, struct vec v, float field[][QUEUE_ROOM], int first) {
    v_compress_store(m, v.x, &field[0][first]);
    v_compress_store(m, v.y, &field[1][first]);
    v_compress_store(m, v.z, &field[2][first]);
}

// Adds to the pixels of the lanes in m, one after the other: two may be the same.
// Of an empty m the pixels are what is behind a queue's end: an older ray's, or the zeros of own_memory.
static inline void add_light(vmask m, struct vec light, vfloat pixel,
                             struct worker_scratch *scratch) {
    COUNT(add_light, call);
    float *first = &scratch->color[(int)v_lane0(pixel)];
    vmask apart = v_cmp_gt(v_abs(pixel - v_splat(v_lane0(pixel)) - v_iota()), v_splat(0.5f));
    if (!v_any(v_and(m, apart))) { // neighbours, as most are
        COUNT(add_light, row);
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
        COUNT(add_light, lane);
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

// A loop over the shapes that the lanes of a mask hit. `left`: bits of the lanes whose shape is still to come. An
// unrolled loop takes every shape in turn, whether a lane hit it or not.
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

#endif
