// Rod marching: W. Edwards, "Rod Marching" (article, 6 July 2012), with perspective (cone marching). No ray of a rod
// is taken too far: the ball of radius d around the axis is empty, and its rays are within `radius` of the axis, so
// all may go on by d − radius. A rod is split in four when it may go on by less than its radius.
//
// Rods of one size march together, one in each lane: "some fancy SSE doing the children in parallel".
#include "rods.h"
#include "core/kernel.h"
#include "core/local_rays.h"
#include "core/sdf.h"
#include "core/trace_context.h"
#include "march/march_step.h"

// A packet of rods.
struct rod_packet {
    struct vec axis;
    vfloat linear, before, steps;
    vmask gone; // out of the bounds with all of its rays
};

// What all rods of one size share.
struct rod_size {
    int side; // pixels
    vfloat spread, from_centre, outer, close, cap;
};

static void append(struct rod_list *list, int x, int y, float t, float steps) {
    list->x[list->count] = (short)x;
    list->y[list->count] = (short)y;
    list->t[list->count] = t;
    list->steps[list->count++] = steps;
}

// The axis is the ray through the rod's middle. A ray to a point of the picture plane and the axis differ, both of unit
// length, by no more than the two points: half of the diagonal at most.
static struct rod_size size_of(int side, const struct job *job, struct point eye) {
    const struct limits *limits = &job->prepared->model.march;
    double per_height = job->view->tan_half_fov / job->frame->height;
    double half = per_height * side * 1.41421356237309505;
    int steps = job->prepared->settings.steps, cap = step_cap(&job->prepared->model);
    return (struct rod_size){.side = side,
                             .spread = v_splat((float)(half * (1.0 + 0x1p-16) + 0x1p-20)),
                             .from_centre = vec_dot(eye.hi, eye.hi),
                             .outer = v_splat((float)(limits->bounds_radius * (1.0 + 0x1p-16))),
                             .close = v_splat((float)limits->hit_distance),
                             .cap = v_splat((float)(steps > 0 && steps < cap ? steps : cap))};
}

// Sets up packet k with `count` rods of a list, from number `first` on.
static void set_out_rods(int first, int count, int left, int top, const struct rod_size *size,
                         const struct job *job, struct point eye, struct trace_context *world,
                         int k, const struct rod_list *rods, struct rod_packet *packet) {
    const struct frame *frame = job->frame;
    double per_height = job->view->tan_half_fov / frame->height;
    float x[LANES], y[LANES], t[LANES] = {0}, steps[LANES] = {0}, there[LANES] = {0};
    for (int lane = 0; lane < LANES; lane++) {
        int i = first + (lane < count ? lane : 0); // spare lanes repeat the first rod
        x[lane] = (float)((2 * (left + rods->x[i]) + size->side - frame->width) * per_height);
        y[lane] = (float)((frame->height - 2 * (top + rods->y[i]) - size->side) * per_height);
        t[lane] = rods->t[i];
        steps[lane] = rods->steps[i];
        there[lane] = lane < count ? 1.0f : 0.0f;
    }
    const struct view *view = job->view;
    struct vec d =
        vec_along(vec_from_doubles(view->forward), vec_from_doubles(view->right), v_load(x));
    d = vec_along(d, vec_from_doubles(view->up), v_load(y));
    packet->axis = vec_scale(d, v_splat(1.0f) / vec_norm(d));
    packet->linear = v_splat(2.0f) * vec_dot(eye.hi, packet->axis);
    packet->steps = packet->before = v_load(steps);
    packet->gone = v_mask_none();
    set_local_origins(eye, world->scene, &world->group->packet[k]);
    set_local_directions(packet->axis, world->scene, &world->group->packet[k]);
    world->group->t[k] = v_load(t);
    world->group->live[k] =
        v_cmp_lt_in(v_cmp_gt(v_load(there), v_splat(0.5f)), packet->steps, size->cap);
}

// Takes one step. A distance is lowered by its rounding error, at most 2⁻¹⁸ of t. Returns false after the last step.
static inline bool rod_step(struct rod_packet *rod, int k, const struct rod_size *size,
                            struct packet_group *group) {
    vmask live = group->live[k];
    ACTIVE(v_count(live));
    COUNT(rod_step, call);
    vfloat t = group->t[k];
    rod->steps = v_add_where(live, rod->steps, v_splat(1.0f));
    vfloat radius = v_madd(size->spread, t, v_madd(t, v_splat(0x1p-18f), size->close));
    vfloat clear = group->distance[k] - radius;
    vmask going = v_cmp_nlt_in(live, clear, radius);
    group->t[k] = t = v_add_where(going, t, clear);
    vfloat wide = v_madd(size->spread, t, size->outer);
    vmask out = v_cmp_lt_in(going, wide * wide, v_madd(t, t + rod->linear, size->from_centre));
    rod->gone = v_or(rod->gone, out);
    vmask on = v_cmp_lt_in(v_andnot(out, going), rod->steps, size->cap);
    group->live[k] = on;
    group->high[k] = v_select(on, group->high[k], v_splat(-INFINITY));
    return v_any(on);
}

// Stores where the pixels of a rod begin.
static void settle(int x, int y, int side, float start, float steps, struct survey *survey) {
    for (int row = y; row < y + side; row++)
        for (int column = x; column < x + side; column++) {
            survey->start[row * TILE + column] = start;
            survey->steps[row * TILE + column] = steps;
        }
}

// Ends `count` rods: their pixels begin here, or their four children go on the next list.
static void land_rods(int first, int count, int across, int down, const struct rod_size *size,
                      vfloat t, const struct rod_packet *rods, struct survey *survey, int least) {
    float at[LANES], steps[LANES], cap = v_lane0(size->cap);
    v_store(t, at);
    v_store(rods->steps, steps);
    for (int lane = 0; lane < count; lane++) {
        int i = first + lane, x = survey->now.x[i], y = survey->now.y[i];
        survey->share[y * TILE + x] += steps[lane] - survey->now.steps[i];
        bool gone = v_mask_bits(rods->gone) >> lane & 1;
        if (gone || steps[lane] >= cap || size->side == least) {
            settle(x, y, size->side, gone ? INFINITY : at[lane], steps[lane], survey);
            continue;
        }
        int half = size->side / 2;
        for (int child = 0; child < 4; child++) {
            int column = x + child % 2 * half, row = y + child / 2 * half;
            if (column < across && row < down)
                append(&survey->next, column, row, at[lane], steps[lane]);
        }
    }
}

// Marches all rods of one size, a group of packets at a time.
static void march_size(int left, int top, const struct rod_size *size, const struct job *job,
                       struct point eye, struct trace_context *world, struct survey *survey) {
    struct packet_group *group = world->group;
    const struct rod_list *rods = &survey->now;
    struct rod_packet packet[GROUP];
    for (int first = 0; first < rods->count; first += GROUP * LANES) {
        int counts[GROUP];
        for (int k = 0; k < GROUP; k++) {
            int rest = rods->count - first - k * LANES;
            counts[k] = rest < 0 ? 0 : rest < LANES ? rest : LANES;
            group->live[k] = v_mask_none();
            if (counts[k] > 0)
                set_out_rods(first + k * LANES, counts[k], left, top, size, job, eye, world, k,
                             rods, &packet[k]);
        }
        start_packets(group);
        struct sole_shape sole = {.shape = -1};
        while (group->count > 0) {
            scene_distances(group, world->scene, &sole);
            for (int i = 0; i < group->count;) {
                int k = group->marching[i];
                if (rod_step(&packet[k], k, size, group))
                    i++;
                else
                    group->marching[i] = group->marching[--group->count];
            }
        }
        int across = job->frame->width - left, down = job->frame->height - top;
        for (int k = 0; k < GROUP; k++)
            land_rods(first + k * LANES, counts[k], across, down, size, group->t[k], &packet[k],
                      survey, world->scene->settings.least);
    }
}

void march_rods(int left, int top, const struct job *job, struct point eye,
                struct trace_context *world, struct survey *survey) {
    const struct settings *settings = &job->prepared->settings;
    double bounds = job->prepared->model.march.bounds_radius, from_centre = 0.0;
    for (int i = 0; i < 3; i++)
        from_centre += job->view->position[i] * job->view->position[i];
    for (int i = 0; i < TILE_PIXELS; i++)
        survey->start[i] = survey->steps[i] = survey->share[i] = 0.0f;
    // From outside of the bounds, a ray's first step decides whether it goes on. So nothing is known about it.
    if (settings->pixels || !(from_centre < bounds * bounds * (1.0 - 0x1p-18)))
        return;
    survey->now.count = survey->next.count = 0;
    for (int y = 0; y < TILE && top + y < job->frame->height; y += settings->size)
        for (int x = 0; x < TILE && left + x < job->frame->width; x += settings->size)
            append(&survey->now, x, y, 0.0f, 0.0f);
    for (int side = settings->size; side >= settings->least && survey->now.count > 0; side /= 2) {
        struct rod_size size = size_of(side, job, eye);
        march_size(left, top, &size, job, eye, world, survey);
        survey->now = survey->next;
        survey->next.count = 0;
    }
}
