// Clusters of a union's shapes: those that stand close together have a common bound, and a search leaves them out
// together.
#pragma once

#include "groups/program.h"

// Sorts the shapes of the program's large unions into clusters, writes their bounds to `clusters`, and puts a step
// before each cluster. `steps` are the program's. Returns the number of clusters.
int cluster_shapes(struct program *program, struct step *steps, struct cluster *clusters);
