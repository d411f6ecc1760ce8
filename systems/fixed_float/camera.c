// The camera's basis in floats, which need no scaling.
#include "scene_tables.h"

void set_camera_basis(struct scene_tables *scene, const struct view *view,
                      const struct frame *frame) {
    scene->half_pixel = (float)(view->tan_half_fov / frame->height);
    for (int k = 0; k < 3; k++) {
        scene->forward[k] = (float)view->forward[k];
        scene->right[k] = (float)view->right[k];
        scene->up[k] = (float)view->up[k];
    }
}
