// Rod marching: W. Edwards, "Rod Marching" (article, 6 July 2012), with the perspective that it
// lacks, as in cone marching: a rod is all rays through a rectangle of pixels, and its radius grows with t.
// A rod goes on until the scene is closer than its radius, and is then split in four, down to pixels.
#include "trace.h"

struct rod {
    int left, top, right, bottom; // pixels, the last two not of it
    double t, distance;           // where it begins, and what the larger rod knows of it
    int steps;                    // evaluations of the rods that it is a part of
    int evaluated;                // those of them that are its first pixel's to tell
};

// Where a rod's march ended: closer than its radius (found), or out of bounds or steps.
struct stop {
    bool found;
    double t, distance, spread;
    int steps, shape;
};

// The axis is the ray through the rectangle's middle. A ray to a point of the picture plane (forward + right·x + up·y)
// and the axis differ, both of unit length, by no more than the two points: half of the diagonal at most.
static double aim(const struct rod *rod, const struct world *world, const struct frame *frame,
                  double *axis) {
    COUNT(aim, call);
    get_direction(0.5 * (rod->left + rod->right - 1), 0.5 * (rod->top + rod->bottom - 1), frame,
                  world->view, axis);
    double per_height = world->view->tan_half_fov / frame->height;
    double across = rod->right - rod->left, down = rod->bottom - rod->top;
    return per_height * sqrt(across * across + down * down);
}

static struct stop march_rod(const struct rod *rod, const struct world *world,
                             const struct frame *frame) {
    COUNT(march_rod, call);
    const struct prepared *scene = world->scene;
    const struct limits *limits = &scene->model.march;
    bool safe = scene->settings.safe;
    double axis[3], p[3];
    struct stop at = {.t = rod->t, .distance = rod->distance, .steps = rod->steps, .shape = -1};
    at.spread = aim(rod, world, frame, axis);
    vec_along(world->view->position, axis, at.t, p);
    while (at.steps < limits->max_steps) {
        COUNT(march_rod, step);
        at.distance = sdf(p, scene, &at.shape);
        at.steps++;
        double radius = most_of(at.spread * at.t, limits->hit_distance);
        // The article's step may leave the rays beside the axis within a surface: up to a radius deep. One that
        // cannot is shorter by the radius, and ends where less than another radius is left.
        double clear = at.distance;
        if (safe) {
            COUNT(march_rod, safe);
            clear -= radius;
        }
        if (clear < radius) {
            at.found = true;
            return at;
        }
        COUNT(march_rod, on);
        at.t += clear;
        vec_along(world->view->position, axis, at.t, p);
        double bounds_sq = scene->bounds_sq;
        if (safe) {
            COUNT(march_rod, wide);
            double bounds = limits->bounds_radius + at.spread * at.t;
            bounds_sq = bounds * bounds;
        }
        if (vec_norm_sq(p) > bounds_sq)
            break;
    }
    return at;
}

// All pixels of the rod are what it found, or nothing.
static void fill(const struct rod *rod, const struct stop *at, double start,
                 const struct world *world, struct frame *frame) {
    COUNT(fill, call);
    struct hit hit = {.found = at->found,
                      .t = at->t + at->distance,
                      .shape = at->found ? at->shape : -1,
                      .evals = at->steps,
                      .last = at->t,
                      .left = at->distance};
    struct share share = {rod->evaluated + at->steps - rod->steps, start};
    for (int row = rod->top; row < rod->bottom; row++)
        for (int column = rod->left; column < rod->right; column++) {
            put_pixel(world, frame, column, row, &hit, share);
            share.evaluated = 0;
        }
}

static void draw_rod(struct rod rod, const struct world *world, struct frame *frame) {
    int across = rod.right - rod.left, down = rod.bottom - rod.top;
    int least = world->scene->settings.least;
    struct stop at = march_rod(&rod, world, frame);
    if (!at.found || (across <= least && down <= least)) {
        bool own = across == 1 && down == 1 && at.steps > rod.steps;
        fill(&rod, &at, own ? rod.t : -1.0, world, frame);
        return;
    }
    struct rod child = {.t = at.t, .distance = at.distance, .steps = at.steps};
    child.evaluated = rod.evaluated + at.steps - rod.steps;
    int columns[3] = {rod.left, rod.left + (across + 1) / 2, rod.right};
    int rows[3] = {rod.top, rod.top + (down + 1) / 2, rod.bottom};
    for (int i = 0; i < 4; i++) {
        child.left = columns[i % 2], child.right = columns[i % 2 + 1];
        child.top = rows[i / 2], child.bottom = rows[i / 2 + 1];
        if (child.left == child.right || child.top == child.bottom)
            continue; // of a single column or row there are two halves
        draw_rod(child, world, frame);
        child.evaluated = 0;
    }
}

static int lesser(int a, int b) {
    return a < b ? a : b;
}

void march_rods(const struct world *world, struct frame *frame) {
    int side = (frame->height + world->scene->settings.down - 1) / world->scene->settings.down;
    for (int top = 0; top < frame->height; top += side)
        for (int left = 0; left < frame->width; left += side) {
            struct rod rod = {.left = left, .top = top};
            rod.right = lesser(left + side, frame->width);
            rod.bottom = lesser(top + side, frame->height);
            draw_rod(rod, world, frame);
        }
}
