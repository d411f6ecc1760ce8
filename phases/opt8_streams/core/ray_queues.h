// Queues of rays that wait to be packed into lanes, and the colours of a strip, to which they add their part: a
// colour is linear in every shadow and mirror ray. Sorted, packed and refilled queues: I. Wald et al., "Active thread
// compaction for GPU path tracing" (HPG 2011); S. Boulos et al., "Adaptive ray packet reordering" (RT 2008).
#pragma once

#include "core/prepared.h"
#include "simd/simd.h"

struct hit;           // core/trace.h
struct lighting;      // core/trace.h
struct packet_rays;   // core/packet_group.h
struct trace_context; // core/trace_context.h

enum {
    PATCH = 8, // pixels on each side
    PATCHES_ACROSS = 4,
    TILE_WIDTH = PATCHES_ACROSS * PATCH,
    TILE_HEIGHT = LANES / PATCHES_ACROSS * PATCH,
    TILE_PIXELS = TILE_WIDTH * TILE_HEIGHT,
    STRIP_TILES = 4, // tiles side by side that share the queues
    STRIP_PIXELS = STRIP_TILES * TILE_PIXELS,
    GROUP_RAYS = GROUP * LANES,     // rays that are marched together
    QUEUE = STRIP_PIXELS,           // rays of each kind; a full queue is emptied
    QUEUE_ROOM = QUEUE + GROUP_RAYS // packing and loading may reach beyond the end
};

// Mirror rays add `weight` times their colour to their pixel.
enum mirror_field { M_HI, M_LO = 3, M_DIRECTION = 6, M_WEIGHT = 9, M_PIXEL, M_BOUNCE, M_FIELDS };
// Shadow rays add `light` to their pixel if nothing is in the way.
enum shadow_field {
    S_HI,
    S_LO = 3,
    S_TO_LIGHT = 6,
    S_DISTANCE = 9,
    S_LIGHT,
    S_PIXEL = 13,
    S_FIELDS
};

// The result of a march. MARCH_FOUND: 1 at a surface, 0 elsewhere; −1: the ray has passed all Mandelbulbs and marches
// on.
enum march_field { MARCH_T, MARCH_LAST_STEP, MARCH_EVALS, MARCH_FOUND, MARCH_FIELDS };

// The state of a shadow ray in a scene with a Mandelbulb. SEGMENT_END: the end of the segment where that may be the
// nearest.
enum segment_field {
    SEGMENT_T,
    SEGMENT_LEAST_SQ,
    SEGMENT_TWICE,
    SEGMENT_EVALS,
    SEGMENT_END,
    SEGMENT_FIELDS
};

// Camera rays of bulb/bulb_single.c, in the Mandelbulb's frame. t counts from the point nearest to the centre.
enum bulb_single_field {
    B_ORIGIN,
    B_DIRECTION = 3,
    B_T = 6, // t as two floats; the march ends at B_TO
    B_T_LOW,
    B_TO,
    B_HEIGHT, // above the plane
    B_SLOPE,
    B_RAY,   // its index in `single`
    B_STEPS, // steps so far
    B_LOW,   // low parts of origin and direction
    B_LANE = B_LOW + 6,
    B_BEFORE = B_LANE, // the path from the camera to t = 0, as two floats
    B_BEFORE_LO,
    B_SLOT, // its pixel
    B_FIELDS
};
enum { BULB_ROOM = STRIP_PIXELS + LANES };

// A worker's queues and colours.
struct ray_queues {
    float color[3][STRIP_PIXELS]; // block after block, lane after lane
    float mirror[M_FIELDS][QUEUE_ROOM], shadow[S_FIELDS][QUEUE_ROOM];
    int mirrors, shadows;
    float camera_direction[3][STRIP_PIXELS],
        marched[MARCH_FIELDS][STRIP_PIXELS];               // camera rays of bulb/bulb_stream.c
    int camera_slot[STRIP_PIXELS / LANES], camera_packets; // the first pixel of each packet
    unsigned camera_active[STRIP_PIXELS / LANES];
    float bulb[B_FIELDS][BULB_ROOM];
    int single_count;
    float segment[SEGMENT_FIELDS][QUEUE_ROOM];
    unsigned under_way[QUEUE_ROOM / LANES]; // the rays of each packet that have not ended
    int *occluders,
        occluder_count; // shapes that can shadow the group in work, and how many
};

// Queues a packet of camera rays for march_camera_stream(). `slot` is the pixel of its first lane.
void queue_camera_rays(struct vec direction, vmask active, int slot, struct trace_context *world);
void march_camera_stream(struct trace_context *world);
// Queues a packet for march_single_bulb(): `single_bulb` in core/primitive.h. `exact` are the directions in double.
void queue_camera_rays_single(struct vec direction, struct vec_double exact, vmask active, int slot,
                              struct trace_context *world);
void march_single_bulb(struct trace_context *world);

// These empty the queues.
void cast_shadows(struct trace_context *world);
void cast_streams(struct trace_context *world); // in a scene with a Mandelbulb
void follow_mirrors(struct trace_context *world);

// Lists the shapes that can shadow the group's hits.
void list_occluders(const struct hit *hit, const struct lighting *light,
                    struct trace_context *world);
// Returns the rays that need no march. Of soft shadow rays: no other shape can bring a term of the estimator below 1,
// and their own shape only in the first two terms. Of hard shadow rays: no shape is near.
vmask trivially_lit(const struct hit *hit, const struct lighting *light,
                    const struct packet_rays *packet, const struct trace_context *world);
// Returns the soft shadow by a ray's own shape: the least of its first two terms.
vfloat self_shadow(const struct primitive *s, struct vec local, struct vec normal,
                   const struct lighting *light, const struct model *model);

static inline struct vec load_vec(float field[][QUEUE_ROOM], int first) {
    return (struct vec){v_load(&field[0][first]), v_load(&field[1][first]),
                        v_load(&field[2][first])};
}

static inline void pack_vec(vmask m, struct vec v, float field[][QUEUE_ROOM], int first) {
    v_compress_store(m, v.x, &field[0][first]);
    v_compress_store(m, v.y, &field[1][first]);
    v_compress_store(m, v.z, &field[2][first]);
}

// Returns the lanes of a packet that have one of `count` rays.
static inline vmask lanes_until(int count) {
    return v_mask_first(count < 0 ? 0 : count);
}

// Returns the lanes whose shape has number i.
static inline vmask is_shape(vfloat shape, int i) {
    return v_cmp_lt(v_abs(shape - v_splat((float)i)), v_splat(0.5f));
}

// Adds light to the pixels of the lanes in m, one after the other, because two may be the same.
static inline void add_light(vmask m, struct vec light, vfloat pixel, struct ray_queues *queues) {
    float from[3][LANES], at[LANES];
    v_store(light.x, from[0]);
    v_store(light.y, from[1]);
    v_store(light.z, from[2]);
    v_store(pixel, at);
    for (unsigned rest = v_mask_bits(m); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), i = (int)at[lane];
        for (int k = 0; k < 3; k++)
            queues->color[k][i] += from[k][lane];
    }
}
