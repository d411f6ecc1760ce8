// The camera's and the light's movements.
#include <math.h>

#include "scene/vector.h"
#include "viewer/world.h"

struct view camera_view(const struct world *world, const struct camera *camera) {
    struct view view = world->scene.view;
    for (int i = 0; i < 3; i++) {
        view.position[i] = camera->position[i];
        view.light_position[i] = camera->light[i];
    }
    if (view_aim(&view, camera->look_at, camera->up) == AIM_OK)
        return view;
    view = world->scene.view; // no script and no turn leads here; the scene's own view is valid
    return view;
}

void camera_fly(const struct world *world, struct camera *camera) {
    struct view view;
    if (camera->flies && scene_view(&world->scene, camera->seconds, &view) == AIM_OK)
        for (int i = 0; i < 3; i++)
            camera->position[i] = view.position[i];
}

void camera_move(struct camera *camera, const struct view *view, const double by[3]) {
    if (by[0] != 0 || by[1] != 0 || by[2] != 0)
        camera->flies = 0;
    for (int i = 0; i < 3; i++) {
        double d = by[0] * view->right[i] + by[1] * view->up[i] + by[2] * view->forward[i];
        camera->position[i] += d;
        camera->look_at[i] += d;
    }
}

void camera_turn(struct camera *camera, double right, double upward) {
    const double limit = 1.5; // radians above level ground; up itself is at pi/2
    double up[3], ahead[3], level[3], side[3];
    camera->flies = 0;
    for (int i = 0; i < 3; i++) {
        up[i] = camera->up[i];
        ahead[i] = camera->look_at[i] - camera->position[i];
    }
    double distance = sqrt(dot3(ahead, ahead));
    if (!normalize3(up) || !normalize3(ahead))
        return;
    double height = asin(fmax(-1, fmin(1, dot3(ahead, up))));
    for (int i = 0; i < 3; i++)
        level[i] = ahead[i] - dot3(ahead, up) * up[i];
    if (!normalize3(level))
        return;
    cross3(up, level, side);
    height = fmax(-limit, fmin(limit, height + upward));
    for (int i = 0; i < 3; i++) {
        double turned = cos(right) * level[i] + sin(right) * side[i];
        camera->look_at[i] =
            camera->position[i] + distance * (cos(height) * turned + sin(height) * up[i]);
    }
}

void camera_move_light(struct camera *camera, const struct view *view, const double by[3]) {
    double up[3] = {camera->up[0], camera->up[1], camera->up[2]}, away[3];
    normalize3(up);
    cross3(view->right, up, away); // right = up x forward, so that this is forward on level ground
    normalize3(away);
    for (int i = 0; i < 3; i++)
        camera->light[i] += by[0] * view->right[i] + by[1] * up[i] + by[2] * away[i];
}
