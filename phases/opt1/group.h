// Groups: what of a node is constant, and the functions of group.c. Points are arrays: ablations change struct vec3.
#pragma once

#include "scene/scene.h"

// A node with what is computed once per scene. What a node lacks is not evaluated.
struct group_node {
    struct node node;
    double cosine[3], sine[3];
    bool rotated[3], repeated, moved; // moved: its transform is not the identity
    bool mirrored, modified;          // modified: by twist, displacement, shell or offset
    double least;                     // of an ellipsoid's radii
    double scale, unit;               // of a gyroid: 2π/cell; its slope
    double half_blend, twice_blend;
};

// Writes the model's nodes as group_nodes.
void group_prepare(const struct model *model, struct group_node *nodes);

// Returns the distance to a group at a point of its coordinates, and the material of its surface near there.
double sdf_group(const double *p, const struct group_node *nodes, int root);
struct material group_material(const double *p, const struct group_node *nodes, int root,
                               const struct material *materials);
