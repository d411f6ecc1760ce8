// The camera's basis in numbers, scaled so that every factor of a product fits 32 bits.
#include <math.h>

#include "scene/scene.h"
#include "scene_tables.h"

enum { FACTOR_BITS = 30, DIRECTION_BITS = 28 }; // of a factor: in all, and of a direction below 4

int direction_shift(const struct view *view, double aspect) {
    int exponent;
    frexp(hypot(1, view->tan_half_fov * hypot(aspect, 1)) / 4, &exponent);
    return exponent > 0 ? exponent : 0;
}

// A direction before normalisation may have any scale. A pixel's offset is below 2^(shift + 2), and is a factor
// too: where it needs more bits than a factor has, it loses `excess`, and right and up gain them.
void set_camera_basis(struct scene_tables *scene, const struct view *view,
                      const struct frame *frame) {
    const struct format *f = &scene->format;
    double half = view->tan_half_fov / frame->height;
    int shift = direction_shift(view, (double)frame->width / frame->height), exponent;
    int excess = shift + f->bits > DIRECTION_BITS ? shift + f->bits - DIRECTION_BITS : 0;
    frexp(half, &exponent);
    scene->half_pixel_shift = FACTOR_BITS - exponent - f->bits + excess;
    scene->half_pixel = llrint(ldexp(half, FACTOR_BITS - exponent));
    for (int k = 0; k < 3; k++) {
        scene->forward[k] = scalar_from(ldexp(view->forward[k], -shift), f);
        scene->right[k] = scalar_from(ldexp(view->right[k], excess - shift), f);
        scene->up[k] = scalar_from(ldexp(view->up[k], excess - shift), f);
    }
}
