// The materials and the light of a packet's hits (B. T. Phong, "Illumination for computer generated pictures", CACM 18
// (1975)), as opt3, opt4, opt6_wide and opt9_convex compute them. Their vectors come before it.
#pragma once

struct materials {
    struct vec color;
    vreal reflectivity, shininess;
};

// Gathers the materials of shapes by their numbers. Lanes that are not `found` get those of shape 0.
static inline struct materials materials_of(vreal shape, vmask found, const struct model *model) {
    real id[LANES], values[5][LANES];
    v_store(v_select(found, shape, v_splat(0.0f)), id);
    for (int lane = 0; lane < LANES; lane++) {
        const struct material *m = &model->materials[model->shapes[(int)id[lane]].material];
        for (int i = 0; i < 3; i++)
            values[i][lane] = (real)m->color[i];
        values[3][lane] = (real)m->reflectivity;
        values[4][lane] = (real)m->shininess;
    }
    return (struct materials){{v_load(values[0]), v_load(values[1]), v_load(values[2])},
                              v_load(values[3]),
                              v_load(values[4])};
}

// Puts the materials of a group's hits into the lanes of m.
static inline void mix_materials(vmask m, const struct materials *mixed, struct materials *all) {
    all->color = vec_select(m, mixed->color, all->color);
    all->reflectivity = v_select(m, mixed->reflectivity, all->reflectivity);
    all->shininess = v_select(m, mixed->shininess, all->shininess);
}

// Returns the colour of hits with normal n that see the light. facing: n·to_light; reach: the light that comes, over its
// distance.
static inline struct vec lit_color(struct vec n, struct vec direction, struct vec to_light,
                                   vreal facing, vreal reach, const struct materials *m,
                                   struct vec emission, struct vec ambient) {
    struct vec base = m->color;
    // The mirrored direction is minus the paper's R.
    vreal shine = vec_dot(vec_reflect(to_light, n), direction);
    vreal least = v_splat(sizeof(real) == sizeof(double) ? 1e-300 : 1e-30);
    vreal specular = v_splat(0.2) * v_pow(v_max(shine, least), m->shininess);
    specular = v_select_or_zero(v_cmp_gt(shine, v_splat(0.0f)), specular);
    return (struct vec){v_madd(emission.x * v_madd(base.x, facing, specular), reach, ambient.x),
                        v_madd(emission.y * v_madd(base.y, facing, specular), reach, ambient.y),
                        v_madd(emission.z * v_madd(base.z, facing, specular), reach, ambient.z)};
}
