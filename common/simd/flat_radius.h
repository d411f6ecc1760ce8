// How flat a solid is where a shadow ray starts. Included by the phase's shadow/shadow_cone.h: its are INLINE and struct
// primitive.
#pragma once

// In surface_offsets: the least radius of curvature at which normal and curvature describe the surface over
// the first two steps of a march (error 0.05 %). Edges count EDGE_FACTOR-fold: they need be 2 offsets away,
// more than two steps.
#define FLAT_OFFSETS 32.0f
#define EDGE_FACTOR 16.0f

// Returns the lesser of the radius of curvature and EDGE_FACTOR times the distance to the nearest edge, at a
// point on the surface.
INLINE vfloat flat_radius(struct vec p, const struct primitive *s) {
    switch (s->type) {
    case SHAPE_SPHERE: return v_splat(s->a);
    case SHAPE_BOX: { // the least of the three is 0 here, the second is the distance to an edge
        vfloat x = v_abs(v_abs(p.x) - v_splat(s->size[0]));
        vfloat y = v_abs(v_abs(p.y) - v_splat(s->size[1]));
        vfloat z = v_abs(v_abs(p.z) - v_splat(s->size[2]));
        return v_splat(EDGE_FACTOR) * v_max(v_min(x, y), v_min(v_max(x, y), z));
    }
    case SHAPE_ROUNDED_BOX: return v_splat(0.0f); // partly flat, partly round: always marched
    case SHAPE_OCTAHEDRON:                        // an edge is where a coordinate is 0
        return v_splat(EDGE_FACTOR) * v_min(v_abs(p.x), v_min(v_abs(p.y), v_abs(p.z)));
    case SHAPE_CONE: {
        vfloat radius = v_sqrt(v_madd(p.x, p.x, p.z * p.z));
        vfloat below = v_max(v_abs(radius - v_splat(s->a)), v_abs(p.y + v_splat(s->c)));
        vfloat above = v_max(v_abs(radius - v_splat(s->b)), v_abs(p.y - v_splat(s->c)));
        vmask cap = v_cmp_lt(v_abs(v_abs(p.y) - v_splat(s->c)), v_splat(1e-5f * s->c));
        return v_min(v_splat(EDGE_FACTOR) * v_min(below, above),
                     v_select(cap, v_splat(INFINITY), radius));
    }
    default: return v_splat(s->b);
    }
}
