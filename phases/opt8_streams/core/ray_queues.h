// Rays that wait until there are enough of them to fill all lanes, and the colours of a tile, to which they add what
// they bring: a colour is linear in every shadow and in every mirrored ray. Queues of rays that are sorted, packed and
// filled again: I. Wald et al., "Active thread compaction for GPU path tracing" (HPG 2011); S. Boulos et al.,
// "Adaptive ray packet reordering" (RT 2008).
#ifndef STREAMS_H
#define STREAMS_H

#include "core/primitive.h"
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
    STRIP_TILES = 4, // tiles side by side, whose rays wait together
    STRIP_PIXELS = STRIP_TILES * TILE_PIXELS,
    GROUP_RAYS = GROUP * LANES,     // rays that are marched together
    QUEUE = STRIP_PIXELS,           // of each kind; a full one is worked off
    QUEUE_ROOM = QUEUE + GROUP_RAYS // what is packed or loaded may reach beyond its end
};

// Mirror rays: what they add to their pixel is `weight` times what they see.
enum mirror_field { M_HI, M_LO = 3, M_DIRECTION = 6, M_WEIGHT = 9, M_PIXEL, M_BOUNCE, M_FIELDS };
// Shadow rays: `light` is what they add to their pixel where nothing is in the way.
enum shadow_field {
    S_HI,
    S_LO = 3,
    S_TO_LIGHT = 6,
    S_DISTANCE = 9,
    S_LIGHT,
    S_PIXEL = 13,
    S_FIELDS
};

// Where a march has ended: MARCH_FOUND is 1 at a surface, else 0; −1: nowhere yet, but no
// Mandelbulb is before it any more.
enum march_field { MARCH_T, MARCH_LAST_STEP, MARCH_EVALS, MARCH_FOUND, MARCH_FIELDS };

// How far a shadow ray has come, where there is a Mandelbulb; SEGMENT_END: of the stretch where that may be the nearest.
enum segment_field {
    SEGMENT_T,
    SEGMENT_LEAST_SQ,
    SEGMENT_TWICE,
    SEGMENT_EVALS,
    SEGMENT_END,
    SEGMENT_FIELDS
};

// Camera rays of bulb/bulb_single.c, in the Mandelbulb's frame, from the place that is nearest to its centre.
enum bulb_single_field {
    B_ORIGIN,
    B_DIRECTION = 3,
    B_T = 6, // from there, as two floats; until B_END
    B_T_LO,
    B_END,
    B_HEIGHT, // over the plane
    B_SLOPE,
    B_RAY,   // its place on the desk
    B_EVALS, // steps so far
    B_LANE,
    B_BEFORE = B_LANE, // the way from the camera to there, as two floats
    B_BEFORE_LO,
    B_SLOT, // its pixel
    B_LO,   // what origin and direction are more, as doubles
    B_FIELDS = B_LO + 6
};

// Those of them that are close to it: see bulb/bulb_chebyshev.h.
enum close_ray_field { C_RAY, C_T, C_T_LO, C_EVALS, C_FIELDS };
enum { BULB_SINGLE_ROOM = STRIP_PIXELS + LANES, CLOSE_ROOM = 2 * STRIP_PIXELS + 2 * LANES };

// A worker's scratch.
struct ray_queues {
    float color[3][STRIP_PIXELS]; // blocks one behind the other, their lanes in a row
    float mirror[M_FIELDS][QUEUE_ROOM], shadow[S_FIELDS][QUEUE_ROOM];
    int mirrors, shadows;
    float camera_direction[3][STRIP_PIXELS],
        marched[MARCH_FIELDS][STRIP_PIXELS];               // camera rays of bulb/bulb_stream.c
    int camera_slot[STRIP_PIXELS / LANES], camera_packets; // the first pixel of each packet
    unsigned camera_active[STRIP_PIXELS / LANES];
    float single[B_FIELDS][BULB_SINGLE_ROOM], close[C_FIELDS][CLOSE_ROOM],
        open[B_LANE][BULB_SINGLE_ROOM];
    int single_count, close_first, close_count, open_count;
    float segment[SEGMENT_FIELDS][QUEUE_ROOM];
    unsigned under_way[QUEUE_ROOM / LANES]; // the rays of each packet that have not ended
    int *occluders,
        occluder_count; // shapes that can come between the group in work and the light, and how many
};

// A packet of camera rays that wait for march_camera_stream(); slot: the pixel of its first lane.
void queue_camera_rays(struct vec direction, vmask active, int slot, struct trace_context *world);
void march_camera_stream(struct trace_context *world);
// The same where a Mandelbulb is sole (core/primitive.h); exact: the directions once more.
void queue_camera_rays_single(struct vec direction, struct vec_double exact, vmask active, int slot,
                              struct trace_context *world);
void march_single_bulb(struct trace_context *world);

// Work off the queues.
void cast_shadows(struct trace_context *world);
void cast_streams(struct trace_context *world); // where there is a Mandelbulb
void follow_mirrors(struct trace_context *world);

// Which shapes can come between the group's hits and the light.
void list_occluders(const struct hit *hit, const struct lighting *light,
                    struct trace_context *world);
// Shadow rays that need no march: of soft ones those on which no shape but their own can bring a term of the estimator
// below 1, and their own neither, but for the first two, since it bulges. Of hard ones those that come near nothing.
vmask trivially_lit(const struct hit *hit, const struct lighting *light,
                    const struct packet_rays *packet, const struct trace_context *world);
// The soft shadow on these: the least of those two terms.
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

static inline vmask lanes_until(int count) { // of so many rays those that this packet has
    return v_mask_first(count < 0 ? 0 : count);
}

static inline vmask is_shape(vfloat shape, int i) {
    return v_cmp_lt(v_abs(shape - v_splat((float)i)), v_splat(0.5f));
}

// Adds to the pixels of the lanes in m, one after the other: two may be the same.
static inline void add_light(vmask m, struct vec light, vfloat pixel, struct ray_queues *queues) {
    COUNT(add_light, call);
    float from[3][LANES], at[LANES];
    v_store(light.x, from[0]);
    v_store(light.y, from[1]);
    v_store(light.z, from[2]);
    v_store(pixel, at);
    for (unsigned rest = v_mask_bits(m); rest; rest &= rest - 1) {
        int lane = __builtin_ctz(rest), i = (int)at[lane];
        COUNT(add_light, lane);
        for (int k = 0; k < 3; k++)
            queues->color[k][i] += from[k][lane];
    }
}

#endif
