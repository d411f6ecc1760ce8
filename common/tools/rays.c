// rays SCENE.json: first hits of given rays with the scene's shapes, in proved enclosures, for tests.
// Reads float64 sextuples (origin, direction) from standard input until its end, writes float64
// quintuples (status, shape, least s, most s, cost; see phase_enclosures).
#include <stdio.h>
#include <stdlib.h>

#include "phase.h"

enum { BATCH = 1024 };

static int answer(const struct prepared *prepared) {
    static double rays[6 * BATCH], enclosures[5 * BATCH];
    for (;;) {
        size_t count = fread(rays, 6 * sizeof(double), BATCH, stdin);
        if (count == 0)
            break;
        if (!phase_enclosures(prepared, count, rays, enclosures))
            return 5;
        if (fwrite(enclosures, 5 * sizeof(double), count, stdout) != count)
            return 2;
    }
    return ferror(stdin) || fflush(stdout) != 0 ? 2 : 0;
}

int main(int argc, char **argv) {
    struct scene scene;
    char error[SCENE_ERROR_SIZE];
    if (argc != 2) {
        fprintf(stderr, "usage: rays SCENE.json <rays >enclosures\n");
        return 2;
    }
    if (!scene_load(argv[1], NULL, &scene, error)) {
        fprintf(stderr, "rays: %s\n", error);
        return 2;
    }
    struct prepared *prepared = phase_prepare(&scene.model, 1);
    int status = prepared ? answer(prepared) : 5;
    if (prepared)
        phase_release(prepared);
    scene_free(&scene);
    return status;
}
