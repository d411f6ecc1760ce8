// Clusters of a union's shapes: none. In opt7_tiles a search for the shapes that rays need leaves out whole clusters.
#pragma once

#include "groups/program.h"

static inline int cluster_shapes(struct program *program, struct step *steps,
                                 struct cluster *clusters) {
    (void)program;
    (void)steps;
    (void)clusters;
    return 0;
}
