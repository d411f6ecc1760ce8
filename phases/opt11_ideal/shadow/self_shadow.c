// The shadow of a ray's own shape: the ratio of a convex solid on which a ray starts is least at the start (PROOFS.md, 5.).
#include "shadow/own_solid.h"
#include "shadow/shadow_rays.h"
#include "types/sdf.h"

vfloat self_shadow(const struct primitive *s, struct vec local, struct vec to_light, vfloat facing,
                   const struct prepared *scene) {
    vfloat strength = v_splat((float)KNOWN(scene)->model.shadow_strength), ratio = facing;
    vfloat offset = v_splat((float)KNOWN(scene)->model.march.surface_offset);
    if (s->eval != EVAL_LINEAR)
        ratio = own_ratio(s, local, turned(s, to_light), offset);
    return v_min(v_splat(1.0f), strength * ratio);
}
