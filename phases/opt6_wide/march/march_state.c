// The end of a ray's march.
#include "march/march.h"

// Not inlined: it runs once per ray, the steps around it many times.
__attribute__((noinline)) void end_rays(struct march_state *at, int step, int k, vmask going,
                                        vmask inside, struct packet_group *group, int cap) {
    vmask live = group->live[k], reached = v_andnot(going, live);
    at->last = v_select(reached, group->distance[k], at->last);
    at->found = v_or(at->found, reached);
    vfloat evals = at->evals + v_splat((float)step);
    if (step >= at->left)
        inside = v_cmp_lt_in(inside, evals, v_splat((float)cap));
    at->evals = v_select(v_andnot(inside, live), evals, at->evals);
    group->live[k] = inside;
    group->high[k] = v_select(inside, group->high[k], v_splat(-INFINITY));
}
