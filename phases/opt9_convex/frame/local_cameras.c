// The camera in the frame of each shape, and whether closed forms can draw the frame. No vectors here.
#include <math.h>

#include "frame/prepare.h"
#include "scene/vector.h"

// Sets the camera relative to the copy in its cell. Returns whether it is outside the box about that copy.
static bool camera_beside_copies(const struct primitive *p, const double from[3], double far,
                                 struct local_camera *camera) {
    bool outside = false;
    for (int k = 0; k < 3; k++) {
        double at = dot3(p->row[k], from);
        at -= p->wide_cell[k] * floor(at * p->wide_per_cell[k] + 0.5);
        split(at, &camera->at[k], &camera->at_low[k]);
        outside = outside || fabs(at) > (double)p->box[k] + far;
    }
    return outside;
}

// Sets all local cameras. Returns whether the camera is within the bounds, above every plane, and outside
// every bounding sphere (repeated shapes: box).
static bool set_each(const struct prepared *prepared, const struct view *view) {
    double radius = prepared->model.march.bounds_radius, far = prepared->model.march.hit_distance;
    bool clear = dot3(view->position, view->position) < radius * radius;
    for (int i = 0; i < prepared->model.shape_count; i++) {
        const struct primitive *p = &prepared->primitives[i];
        struct local_camera *camera = &prepared->cameras[i];
        double from[3];
        for (int k = 0; k < 3; k++)
            from[k] = view->position[k] - p->centre[k];
        const double *axis[3] = {view->right, view->up, view->forward};
        if (p->eval == EVAL_LINEAR) {
            double height = dot3(p->row[0], from) - p->offset;
            camera->height = (float)height;
            for (int k = 0; k < 3; k++)
                camera->centre[k] = (float)dot3(p->row[0], axis[k]);
            clear = clear && height > far;
            continue;
        }
        if (p->repeated) {
            clear = clear && camera_beside_copies(p, from, far, camera);
            for (int k = 0; k < 3; k++) {
                camera->centre[k] = (float)-dot3(p->row[k], view->position);
                for (int j = 0; j < 3; j++)
                    camera->axis[j][k] = (float)dot3(p->row[k], axis[j]);
            }
            continue;
        }
        for (int k = 0; k < 3; k++) {
            camera->at[k] = (float)dot3(p->row[k], from);
            camera->centre[k] = (float)-dot3(from, axis[k]);
        }
        // Rays to a Mandelbulb are marched from anywhere outside it: see camera_in_bulb().
        clear = clear &&
                (p->type == SHAPE_MANDELBULB || sqrt(dot3(from, from)) > (double)p->bound + far);
    }
    return clear;
}

// Returns whether the camera is inside a Mandelbulb. Its rays hit at once, and normals come from estimates of
// −0.2, where 14 bits are 1e-5 and the step is 1e-4: 18° of error (median of 57 cameras). fallback/march.c
// has all bits. Precondition: set_each() returned true, so no other shape is nearer.
static bool camera_in_bulb(const struct prepared *prepared, const struct view *view,
                           const struct lane_kernel *lanes) {
    if (!prepared->known.bulbs)
        return false;
    double distance;
    int nearest;
    if (!lanes->distances(prepared, 1, view->position, &distance, &nearest))
        return true; // memory is short: a march is always right
    return !(distance > prepared->model.march.hit_distance);
}

bool set_local_cameras(const struct prepared *prepared, const struct view *view,
                       const struct lane_kernel *lanes) {
    return set_each(prepared, view) && !camera_in_bulb(prepared, view, lanes);
}

// Taller tiles let more rays share the wait for the slowest (Mandelbulbs), or give the sort of shadow rays
// more rays (BVH).
int tile_height(const struct prepared *prepared, int height) {
    if (prepared->known.bulbs)
        return height > 256 ? 128 : 64;
    return prepared->bvh.levels ? 64 : 8;
}
