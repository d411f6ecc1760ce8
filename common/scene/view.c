// The camera's frame, and where the camera is at a time of an animation.
#include <math.h>

#include "scene/internal.h"
#include "scene/vector.h"

enum aim view_aim(struct view *view, const double look_at[3], const double upward[3]) {
    double up[3] = {upward[0], upward[1], upward[2]};
    for (int i = 0; i < 3; i++)
        view->forward[i] = look_at[i] - view->position[i];
    bool seen = normalize3(view->forward);
    bool is_direction = normalize3(up);
    cross3(up, view->forward, view->right);
    if (!seen)
        return AIM_AT_ITSELF;
    // 1e-6 is the sine of the angle. Below it rounding errors would decide the camera's frame.
    if (!is_direction || !(sqrt(dot3(view->right, view->right)) > 1e-6))
        return AIM_ALONG_UP;
    normalize3(view->right);
    cross3(view->forward, view->right, view->up);
    return AIM_OK;
}

enum aim scene_view(const struct scene *scene, double seconds, struct view *view) {
    const struct flight *flight = &scene->flight;
    *view = scene->view;
    if (flight->path.type == PATH_NONE)
        return AIM_OK;
    path_follow(&flight->path, scene->view.position, seconds, view->position);
    return view_aim(view, flight->look_at, flight->up);
}
