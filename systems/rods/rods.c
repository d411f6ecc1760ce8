// Rod marching: W. Edwards, "Rod Marching" (article, 6 July 2012). A rod holds all rays through a rectangle of pixels.
// It marches until the scene is closer than its radius, and is then split in four, down to pixels. The article's rods
// are parallel; here the radius grows with t, as in cone marching.
#include "rods.h"

__attribute__((noinline)) double scene_distance(const double *p, const struct prepared *scene,
                                                int *nearest) {
    return sdf(p, scene, nearest);
}

struct rod {
    int left, top, right, bottom; // pixels; right and bottom are exclusive
    double t, distance; // where it begins, and the scene's distance found there by its parent
    int steps;          // evaluations of all its ancestors
    int evals;          // how many of them count for its first pixel
};

// Where a rod's march ended: closer to the scene than its radius (found), or out of bounds or steps.
struct rod_end {
    bool found;
    double t, distance, spread;
    int steps, shape;
};

// Computes the axis, the ray through the rectangle's middle. Returns the spread: the rod's radius at t = 1.
// Two unit directions differ by no more than their points on the picture plane: half of the diagonal at most.
static double rod_axis(const struct rod *rod, const struct world *world, const struct frame *frame,
                       double *axis) {
    get_direction(0.5 * (rod->left + rod->right - 1), 0.5 * (rod->top + rod->bottom - 1), frame,
                  world->view, axis);
    double pixel_size = world->view->tan_half_fov / frame->height;
    double across = rod->right - rod->left, down = rod->bottom - rod->top;
    return pixel_size * sqrt(across * across + down * down);
}

static struct rod_end march_rod(const struct rod *rod, const struct world *world,
                                const struct frame *frame) {
    const struct prepared *scene = world->scene;
    const struct limits *limits = &scene->model.march;
    bool safe = state_of(scene)->settings.safe;
    double axis[3], p[3];
    struct rod_end at = {.t = rod->t, .distance = rod->distance, .steps = rod->steps, .shape = -1};
    at.spread = rod_axis(rod, world, frame, axis);
    vec_along(world->view->position, axis, at.t, p);
    while (at.steps < limits->max_steps) {
        at.distance = scene_distance(p, scene, &at.shape);
        at.steps++;
        double radius = max_of(at.spread * at.t, limits->hit_distance);
        // The article's step may take rays beside the axis into a surface, up to a radius deep. A safe step is
        // shorter by the radius, and the march ends where less than another radius is left.
        double step = at.distance;
        step -= safe ? radius : 0.0;
        if (step < radius) {
            at.found = true;
            return at;
        }
        at.t += step;
        vec_along(world->view->position, axis, at.t, p);
        double bounds_sq = scene->bounds_sq;
        if (safe) {
            double bounds = limits->bounds_radius + at.spread * at.t;
            bounds_sq = bounds * bounds;
        }
        if (vec_norm_sq(p) > bounds_sq)
            break;
    }
    return at;
}

// Gives all pixels of the rod its hit, or its miss.
static void fill_rod(const struct rod *rod, const struct rod_end *at, double start,
                     const struct world *world, struct frame *frame) {
    struct hit hit = {.found = at->found,
                      .t = at->t + at->distance,
                      .shape = at->found ? at->shape : -1,
                      .evals = at->steps};
    struct pixel_cost cost = {rod->evals + at->steps - rod->steps, start, at->t, at->distance};
    for (int row = rod->top; row < rod->bottom; row++)
        for (int column = rod->left; column < rod->right; column++) {
            put_pixel(world, frame, column, row, &hit, cost);
            cost.evals = 0;
        }
}

// Marches a rod and fills its pixels, or draws its four quarters from where it ended.
static void draw_rod(struct rod rod, const struct world *world, struct frame *frame) {
    int across = rod.right - rod.left, down = rod.bottom - rod.top;
    int smallest = state_of(world->scene)->settings.least;
    struct rod_end at = march_rod(&rod, world, frame);
    if (!at.found || (across <= smallest && down <= smallest)) {
        bool own = across == 1 && down == 1 && at.steps > rod.steps;
        fill_rod(&rod, &at, own ? rod.t : -1.0, world, frame);
        return;
    }
    struct rod child = {.t = at.t, .distance = at.distance, .steps = at.steps};
    child.evals = rod.evals + at.steps - rod.steps;
    int columns[3] = {rod.left, rod.left + (across + 1) / 2, rod.right};
    int rows[3] = {rod.top, rod.top + (down + 1) / 2, rod.bottom};
    for (int i = 0; i < 4; i++) {
        child.left = columns[i % 2], child.right = columns[i % 2 + 1];
        child.top = rows[i / 2], child.bottom = rows[i / 2 + 1];
        if (child.left == child.right || child.top == child.bottom)
            continue; // a single column or row has two halves
        draw_rod(child, world, frame);
        child.evals = 0;
    }
}

static int min_int(int a, int b) {
    return a < b ? a : b;
}

void march_rods(const struct world *world, struct frame *frame) {
    int side = (frame->height + state_of(world->scene)->settings.down - 1) /
               state_of(world->scene)->settings.down;
    for (int top = 0; top < frame->height; top += side)
        for (int left = 0; left < frame->width; left += side) {
            struct rod rod = {.left = left, .top = top};
            rod.right = min_int(left + side, frame->width);
            rod.bottom = min_int(top + side, frame->height);
            draw_rod(rod, world, frame);
        }
}
