// In a generated kernel: the program's functions for groups, compiled once for all scenes.
#pragma once

#include "fields/rays.h"
#include "hit/solids.h"

#define FROM_PROGRAM __attribute__((visibility("hidden")))

FROM_PROGRAM void field_row(const struct field *field, struct vec o, struct field_rays *rays,
                            int packets) {
    groups_of->group_calls->row(field, o, rays, packets);
}

FROM_PROGRAM bool field_in_frustum(const struct field *field, const struct vec axes[3],
                                   const float centre[3], const float edges[4],
                                   const float sides[4]) {
    return groups_of->group_calls->in_frustum(field, axes, centre, edges, sides);
}

FROM_PROGRAM vfloat field_distance(const struct field *field, struct vec p) {
    return groups_of->group_calls->distance(field, p);
}

FROM_PROGRAM struct field_surface field_surface(const struct field *field, struct vec p,
                                                vmask found) {
    return groups_of->group_calls->surface(field, p, found);
}

FROM_PROGRAM struct field_surface sharp_surface(const struct sharp *sharp, struct vec p,
                                                vmask found) {
    return groups_of->group_calls->sharp_surface(sharp, p, found);
}

FROM_PROGRAM vmask field_enter(const struct field *field, struct vec o, struct vec d, vmask active,
                               vfloat near, vfloat far, vfloat *t) {
    return groups_of->group_calls->enter(field, o, d, active, near, far, t);
}

FROM_PROGRAM vmask sharp_enter(const struct sharp *sharp, struct vec o, struct vec d, vmask active,
                               vfloat from, vfloat to, vfloat *t) {
    return groups_of->group_calls->sharp(sharp, o, d, active, from, to, t);
}

FROM_PROGRAM vfloat field_widest(const struct field *field, struct vec o, struct vec d,
                                 vmask active, vfloat near, vfloat far, vfloat best, float lit) {
    return groups_of->group_calls->widest(field, o, d, active, near, far, best, lit);
}

static bool take_groups(const struct job *job) {
    groups_of = job->prepared;
    return true;
}
