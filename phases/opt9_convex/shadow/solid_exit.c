// The first steps of shadow rays that start on a solid, while no other shape can be nearer.
#include "shadow/shadow_batch.h"
#include "shadow/soft_shadow.h"

_Static_assert(CHECK_INTERVAL >= 2, "begin_solid_exit: no term behind the second is the least");

// A packet that leaves its solid. clearance: distance from the solid's position to the nearest other bounding
// sphere.
struct solid_exit {
    struct shadow_candidate candidate;
    const struct primitive *solid;
    vfloat clearance;
    vmask still, done;
    bool settled; // no later term can be the least
};

// Returns whether the packet starts on a solid and has a ray to march. begun: the rays have taken
// CHECK_INTERVAL steps. On a convex solid, the least term is one of the first two (PROOFS.md, 3.).
static bool begin_solid_exit(struct batch_packet *w, struct solid_exit *l, bool begun,
                             const struct tile_context *work) {
    const struct prepared *scene = work->scene;
    if (w->solid < 0 || v_all(is_idle(w)))
        return false;
    const struct primitive *s = &scene->primitives[w->solid];
    w->local_to = turned(s, w->rays.to_light);
    set_candidate_ray(&w->rays, w->solid, &l->candidate, work);
    l->solid = s;
    l->clearance = v_splat(scene->extras[w->solid].clearance * (1 - 1e-5f) -
                           1e-6f * (float)scene->model.march.bounds_radius);
    l->still = is_idle(w);
    l->done = w->march.done;
    l->settled = begun && s->convex && scene->plane_count == 0;
    return true;
}

// Returns the distance to the solid. `square`: the squared distance to its position.
static inline vfloat distance_of_own_solid(const struct solid_exit *l, vfloat t, vfloat *square) {
    const struct shadow_candidate *n = &l->candidate;
    if (n->power) { // a sphere: see distance_along, which takes the root of the same square
        vfloat power = v_madd(t, t + n->slope, n->constant);
        *square = v_max(power + v_splat(l->solid->bound_sq), v_splat(0.0f));
        return power / (v_sqrt(*square) + v_splat(l->solid->a));
    }
    struct vec p = vec_along(n->origin, n->direction, t);
    *square = vec_dot(p, p);
    return distance_at(p, l->solid, v_mask_none());
}

// One step of the rays to which no other shape can be nearer. Returns whether any ray took it.
static bool solid_exit_step(struct batch_packet *w, struct solid_exit *l, vfloat strength,
                            vfloat hit, const struct prepared *scene) {
    struct shadow_march *m = &w->march;
    vfloat square, h = distance_of_own_solid(l, m->t, &square), room = l->clearance - h;
    vmask sure = v_and(v_cmp_gt(room, v_splat(0.0f)), v_cmp_lt(square, room * room));
    vmask still = v_or(l->still, v_not(sure));
    if (v_all(still))
        return false;
    for (int k = 0; k < scene->plane_count; k++)
        h = v_min(h, plane_height(&scene->primitives[scene->planes[k]], v_mask_none(), w));
    step_others(m, still, h, strength, hit, l->settled);
    l->done = v_or(l->done, v_andnot(still, m->done));
    l->still = v_or(still, m->done);
    return true;
}

// At most `steps` steps of each packet. The packets take turns, because a step depends on the root of the one
// before it. Returns whether any packet took the last step. Rays that cannot go on wait.
static bool solid_exit_steps(struct shadow_batch *batch, int steps, bool begun, vfloat strength,
                             vfloat hit, const struct tile_context *work) {
    struct solid_exit packets[BATCH_PACKETS];
    unsigned out = 0;
    for (int i = 0; i < batch->moving; i++)
        out |= (unsigned)begin_solid_exit(&batch->packet[i], &packets[i], begun, work) << i;
    unsigned open = out;
    for (; open && steps > 0; steps--)
        for (unsigned rest = open; rest; rest &= rest - 1) {
            int i = __builtin_ctz(rest);
            if (!solid_exit_step(&batch->packet[i], &packets[i], strength, hit, work->scene))
                open &= ~(1u << i);
        }
    for (unsigned rest = out; rest; rest &= rest - 1) {
        int i = __builtin_ctz(rest);
        batch->packet[i].waits = open >> i & 1 ? packets[i].still : v_mask_all();
        batch->packet[i].march.done = packets[i].done;
    }
    return open;
}

// In each packet, a few rays graze a round solid and take hundreds of steps to leave it. After CHECK_INTERVAL
// steps, a cone query ends the rays that no shape can darken any more, and the rest move together.
void leave_own_solid(struct shadow_batch *batch, vfloat strength, vfloat hit,
                     const struct tile_context *work) {
    int most = work->scene->model.march.max_steps;
    batch->moving = batch->count;
    if (!solid_exit_steps(batch, int_min(most, CHECK_INTERVAL), false, strength, hit, work))
        return;
    query_ahead(batch, batch->count, work);
    compact_packets(batch, work->scratch);
    solid_exit_steps(batch, most - CHECK_INTERVAL, true, strength, hit, work);
}
