// probe SCENE.json <points >distances: a phase's signed distances, for tests. Reads float64 x y z triples from standard
// input until its end. Writes two float64 per point: distance, nearest shape.
// rays SCENE.json <rays >enclosures, built with -DRAYS: proved enclosures of first hits, for tests of the phase truth.
// Reads sextuples (origin, direction). Writes five numbers per ray: status, shape, lower and upper bound of s,
// evaluations (see phase_enclosures).
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "phase.h"

enum { BATCH = 4096 };

#ifdef RAYS
#define USAGE "rays SCENE.json <rays >enclosures"
enum { READ = 6, WRITTEN = 5 }; // numbers of one ray

static bool answer(const struct prepared *prepared, size_t count, const double *rays,
                   double *enclosures) {
    return phase_enclosures(prepared, count, rays, enclosures);
}
#else
#define USAGE "probe SCENE.json <points >distances"
enum { READ = 3, WRITTEN = 2 }; // numbers of one point

static bool answer(const struct prepared *prepared, size_t count, const double *points,
                   double *pairs) {
    static double distance[BATCH];
    static int nearest[BATCH];
    bool answered = phase_distances(prepared, count, points, distance, nearest);
    for (size_t i = 0; i < count; i++) {
        pairs[2 * i] = distance[i];
        pairs[2 * i + 1] = nearest[i];
    }
    return answered;
}
#endif

static int answer_all(const struct prepared *prepared) {
    static double in[READ * BATCH], out[WRITTEN * BATCH];
    for (size_t count; (count = fread(in, READ * sizeof *in, BATCH, stdin)) > 0;) {
        if (!answer(prepared, count, in, out))
            return 5;
        if (fwrite(out, WRITTEN * sizeof *out, count, stdout) != count)
            return 2;
    }
    return ferror(stdin) || fflush(stdout) != 0 ? 2 : 0;
}

int main(int argc, char **argv) {
    struct scene scene;
    char error[SCENE_ERROR_SIZE];
    if (argc != 2) {
        fprintf(stderr, "usage: " USAGE "\n");
        return 2;
    }
    if (!scene_load(argv[1], NULL, &scene, error)) {
        fprintf(stderr, "%.*s: %s\n", (int)strcspn(USAGE, " "), USAGE, error);
        return 2;
    }
    struct prepared *prepared = phase_prepare(&scene.model, 1);
    int status = prepared ? answer_all(prepared) : 5;
    if (prepared)
        phase_release(prepared);
    scene_free(&scene);
    return status;
}
