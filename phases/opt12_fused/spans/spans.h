// What a row of the picture can show: conservative spans, cut before a pixel is drawn. Plain doubles, no vectors.
// A generated kernel has this text inside, with the scene as constants; so have the tests, without a kernel.
//
// "May" is conservative: where a bit is not set, no ray of the span, as the kernel computes it in float, meets the
// shape. "Sure" likewise: SPAN_PLANE and SPAN_SOLID hold for each ray.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "types/known_scene.h"

struct view; // phase.h

enum { SPAN_SHAPES = 16, SPAN_DARK = 64, SPAN_BAND = 16, SPAN_MOST = 129 };
enum { SPAN_SIDES = 24, SPAN_ITEMS = 96, SPAN_GROUPS = 1024, SPAN_GUARDS = 2 };

enum span_kind {
    SPAN_BACKGROUND, // no shape may be met: hits is 0
    SPAN_PLANE,      // each ray meets `shape`, a plane, within the bounds, and nothing before it
    SPAN_SOLID, // each ray meets `shape`, a solid, well inside of its outline, and nothing before it
    SPAN_MIXED  // any of `hits`, or nothing
};

// Pixels x0 <= x < x1, multiples of the frame's grain but for the picture's right edge.
struct fused_span {
    int x0, x1;
    enum span_kind kind;
    int shape;          // of SPAN_PLANE and SPAN_SOLID
    uint64_t hits;      // bit i: a camera ray may meet shape i (solids and planes)
    uint64_t darkeners; // bit i: solid i may darken a point of a plane that is seen here
    uint64_t reflected; // bit i: the mirror ray of a plane that is seen here may meet solid i
};

// Solid `solid` can darken no point of plane `plane` that is further than this from `centre`, a point of the plane. A
// solid may have several (parts of it): a point outside of all of them is not darkened.
struct dark_region {
    int solid, plane;
    float centre[3], radius_sq;
};

// What a span is cut by. Each shape has a bit of each: its first in a mask of 64 bits.
enum span_role { ROLE_MAY = 0, ROLE_SURE = 16, ROLE_DARK = 32, ROLE_REFLECTED = 48 };

// A region of the picture. A ray (x, y, 1), in camera axes, is in it if x >= left.u + left.v·y for each `left`, x <= …
// for each `right`, and, if `curved`: xx·x² + 2·(xy·y + x)·x + yy·y² + 2·y·y + one >= 0, on the side where
// side·(x, y, 1) > 0. No row above `top` or below `bottom` meets it.
struct span_item {
    int bit; // role + shape
    double top, bottom;
    bool curved;
    int lefts, rights;
    struct span_side {
        double u, v;
    } left[SPAN_SIDES], right[SPAN_SIDES];
    struct span_conic {
        double xx, xy, x, yy, y, one, side[3];
    } conic;
};

// What does not change within a frame.
struct fused_frame {
    int width, height, grain;
    double per_pixel; // half a pixel in the picture's plane at distance 1: tan_half_fov / height
    double eye[3], axis[3][3], light[3]; // axis: right, up, forward
    double reach[3];                     // the picture's largest |x|, |y|, and length of (x, y, 1)
    int shapes;
    const struct primitive *shape; // [shapes]
    double bounds_radius, slope;   // slope: 1 / shadow strength; a cone about a light ray
    double fog, emission[3];
    uint64_t planes, solids;
    uint64_t above; // solids that are above all planes
    int dark_count;
    struct dark_region dark[SPAN_DARK];
    uint64_t pair[SPAN_SHAPES];   // bit j: solid j may darken a point of shape i
    uint64_t mirror[SPAN_SHAPES]; // bit j: a mirror ray of shape i may meet shape j
    // A mirror ray of solid i from o in direction d meets no other solid if guard·d >= 0 and guard·o >= guard_top,
    // by either guard. guard_top: infinite where there is none.
    float guard[SPAN_SHAPES][SPAN_GUARDS][3], guard_top[SPAN_SHAPES][SPAN_GUARDS];
    int items;
    struct span_item item[SPAN_ITEMS];
};

// The regions in a band of rows.
struct fused_band {
    int top, rows;
    int count;
    struct band_span { // columns from lo to hi, by row of the band; lo > hi: none
        int bit;
        float lo[SPAN_BAND], hi[SPAN_BAND];
    } span[SPAN_ITEMS];
};

// Sets the frame's constants. Returns false if the frame is not of the kind that spans can draw (a solid that reaches out
// of the bounds, more shapes than there is room for, ...). Precondition: set_local_cameras() returned true: the camera
// is above all planes, outside of all bounding spheres and within the bounds; no groups, Mandelbulbs, repetition.
KERNEL_SHARED bool fused_frame_set(const struct known_scene *scene, const struct view *view,
                                   int width, int height, int grain, struct fused_frame *frame);

// Sets the outlines in rows top <= y < top + rows, at most SPAN_BAND.
KERNEL_SHARED void fused_band_set(const struct fused_frame *frame, int top, int rows,
                                  struct fused_band *band);

// Cuts rows y0 <= y < y0 + rows of the band, taken together, into spans in increasing x that cover [0, width).
// Returns their number: 129 at most, for each of 64 bits changes twice at most.
KERNEL_SHARED int fused_spans_of_rows(const struct fused_frame *frame,
                                      const struct fused_band *band, int y0, int rows,
                                      struct fused_span spans[SPAN_MOST]);

// A polynomial of degree 5 gives the light and the fog of plane `plane` along rows y0 <= y < y0 + rows, between columns
// x0 and x1. Returns how far apart its six nodes may be, in pixels: 64, 32 or 16; 0: there is no such polynomial. The
// nodes reach three spacings beyond x0 and x1. The error is below `most` (of a colour), but for rounding in float.
KERNEL_SHARED int fused_spacing(const struct fused_frame *frame, int plane, int y0, int rows,
                                int x0, int x1, double most);
