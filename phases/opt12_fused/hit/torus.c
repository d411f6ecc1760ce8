// Where rays enter a torus.
#include "hit/torus_march.h"

KERNEL_INLINE vmask enter_torus(struct vec c, struct vec d, const struct primitive *s, vmask near,
                                vfloat *t) {
    struct torus_march w;
    begin_torus(c, d, s, near, *t, &w);
    for (int step = 0; step < MOST_TORUS_STEPS && v_any(w.going); step++)
        step_torus(c, d, s, &w);
    *t = w.at;
    return w.found;
}
