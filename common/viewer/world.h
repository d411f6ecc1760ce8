// A scene that is looked at, and the camera in it.
#pragma once

#include "scene/scene.h"

// Where one looks from and to. Lengths are scene units.
struct camera {
    double position[3], look_at[3], up[3];
    double light[3];
    double seconds; // of the animation
    long flies; // 1: it follows the scene's path; as wide as a double, so that memcmp can compare
};

struct world {
    char path[4096];
    struct scene scene;
    struct camera camera; // the scene file's own
};

// Returns the scene `name`: a path, or the name of a file of common/scenes. It is loaded once and
// kept until worlds_free. Returns NULL with one line in `error` (SCENE_ERROR_SIZE bytes).
struct world *world_open(const char *name, char *error);
// Returns what world_open() finds the scene by on every machine: its name if it is one of common/scenes, else its path.
const char *world_called(const struct world *world);
// Returns the scene `steps` after `world` in the list of all scenes of common/scenes, the animated
// ones last. Errors as for world_open.
struct world *world_next(const struct world *world, int steps, char *error);
void worlds_free(void);

// Returns the view of this camera, computed as for a scene file with these values.
struct view camera_view(const struct world *world, const struct camera *camera);

// Puts a camera that flies where the scene's path leads at its time.
void camera_fly(const struct world *world, struct camera *camera);
// Moves the camera along its right, upward and forward directions. If it moves, it leaves the scene's path.
void camera_move(struct camera *camera, const struct view *view, const double by[3]);
// Turns the camera: `right` about its `up`, then `upward`, in radians. It stops short of `up`, and leaves the
// scene's path.
void camera_turn(struct camera *camera, double right, double upward);
// Moves the light along the camera's right, along `up`, and away from the camera on level ground.
void camera_move_light(struct camera *camera, const struct view *view, const double by[3]);

// Writes the scene with this camera, which has no path, and light as a scene file. Numbers have 17 digits, so
// that reading it gives the same view. Returns false with one line in `error`.
bool world_save(const struct world *world, const struct camera *camera, const char *path,
                char *error);
