// probe SCENE.json: a phase's signed distances at given points, for tests. Reads float64 x y z
// triples from standard input until its end, writes float64 distance and nearest shape per point.
#include <stdio.h>
#include <stdlib.h>

#include "phase.h"

enum { BATCH = 4096 };

static int probe(const struct prepared *prepared) {
    static double points[3 * BATCH], distance[BATCH], pairs[2 * BATCH];
    static int nearest[BATCH];
    for (;;) {
        size_t count = fread(points, 3 * sizeof(double), BATCH, stdin);
        if (count == 0)
            break;
        if (!phase_distances(prepared, count, points, distance, nearest))
            return 5;
        for (size_t i = 0; i < count; i++) {
            pairs[2 * i] = distance[i];
            pairs[2 * i + 1] = nearest[i];
        }
        if (fwrite(pairs, 2 * sizeof(double), count, stdout) != count)
            return 2;
    }
    return ferror(stdin) || fflush(stdout) != 0 ? 2 : 0;
}

int main(int argc, char **argv) {
    struct scene scene;
    char error[SCENE_ERROR_SIZE];
    if (argc != 2) {
        fprintf(stderr, "usage: probe SCENE.json <points >distances\n");
        return 2;
    }
    if (!scene_load(argv[1], NULL, &scene, error)) {
        fprintf(stderr, "probe: %s\n", error);
        return 2;
    }
    struct prepared *prepared = phase_prepare(&scene.model, 1);
    int status = prepared ? probe(prepared) : 5;
    if (prepared)
        phase_release(prepared);
    scene_free(&scene);
    return status;
}
