// The surroundings of hits, their normals and their light. Included by core/trace.h, after simd/simd.h.
#pragma once

struct packet_rays; // core/packet_group.h

struct lighting {
    struct vec to_light;     // of unit length
    vfloat distance, facing; // facing: normal·to_light
    vmask front;             // faces the light
};

static inline struct vec from_to(struct point from, const double to[3]) {
    float hi[3], lo[3];
    for (int i = 0; i < 3; i++)
        split(to[i], &hi[i], &lo[i]);
    return vec_scale(point_sub(from, hi, lo), v_splat(-1.0f));
}

static inline struct lighting light_from(struct point p, struct vec n, vmask found,
                                         const struct view *view) {
    vfloat zero = v_splat(0.0f);
    struct vec to_light = from_to(p, view->light_position);
    vfloat distance = vec_norm(to_light);
    to_light = vec_scale(to_light, v_splat(1.0f) / distance);
    vfloat facing = vec_dot(n, to_light);
    // A surface turned away is unlit whatever the shadow. A light on the surface has no direction.
    vmask front = v_and(found, v_and(v_cmp_gt(facing, zero), v_cmp_gt(distance, zero)));
    return (struct lighting){to_light, distance, facing, front};
}

// The surroundings of a hit, evaluated with the hit as origin. The march is less exact: it has rounded origin and
// direction in the frames of all shapes.
struct hit_surroundings {
    vfloat distance, shape; // of the nearest
    vmask contact;          // another shape is within two normal steps of it
};

struct hit_surroundings near_hit(vmask found, const struct prepared *scene,
                                 struct packet_rays *packet);
// A hit's normal, on the side that the ray comes from, and the distance's slope along the ray: 1e30 where it is unknown.
struct hit_normal {
    struct vec normal;
    vfloat slope;
    vmask inward; // the ray comes from inside the shape
};

// Returns the normals of hits that are the origins of the packet.
struct hit_normal normal_at(struct vec direction, vmask found, const struct hit_surroundings *near,
                            const struct prepared *scene, const struct packet_rays *packet);
