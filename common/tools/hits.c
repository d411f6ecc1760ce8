// hits SCENE.json [--any] [--embree] [--coherent] [--reps R] [-o FILE] <rays
//
// Traces rays, float32 septuples (origin, unit direction, far) in their order on one thread, by a phase with
// closed-form intersections and, with --embree, by Intel's Embree in turns with it, and times both. --any: occlusion
// queries up to `far`. --coherent: tells Embree, not the phase, that the rays go in similar directions.
//
// FILE gets float32 pairs (t, shape) of the phase, then Embree's; with --any t is −inf for an occluded ray. Standard
// output gets one JSON object with the nanoseconds of each repetition; "embree": why it did not run.
#include <getopt.h>
#include <jansson.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "driver/variant.h"
#include "timing/timer.h"
#include "tools/embree.h"

enum { PADDING = 16, MAX_REPS = 1000000 };

// Allocates all arrays in one piece, each with PADDING floats after its last ray.
static bool make_rays(struct ray_arrays *r, size_t count) {
    size_t room = (count + PADDING + 15) / 16 * 16;
    r->count = count;
    r->memory = aligned_alloc(64, 11 * room * sizeof(float));
    if (!r->memory)
        return false;
    memset(r->memory, 0, 11 * room * sizeof(float));
    for (int k = 0; k < 3; k++) {
        r->origin[k] = r->memory + (size_t)k * room;
        r->direction[k] = r->memory + (size_t)(3 + k) * room;
    }
    r->far = r->memory + 6 * room;
    for (int tracer = 0; tracer < 2; tracer++) {
        r->t[tracer] = r->memory + (size_t)(7 + 2 * tracer) * room;
        r->shape[tracer] = r->memory + (size_t)(8 + 2 * tracer) * room;
    }
    return true;
}

// Reads standard input to its end. Returns false after printing an error.
static bool read_rays(struct ray_arrays *rays) {
    size_t room = 1 << 16, size = 0, got;
    float (*all)[7] = malloc(room * sizeof *all);
    while (all && (got = fread((char *)all + size, 1, room * sizeof *all - size, stdin)) > 0) {
        size += got;
        if (size == room * sizeof *all) {
            void *more = realloc(all, (room *= 2) * sizeof *all);
            if (!more)
                free(all);
            all = more;
        }
    }
    size_t count = size / sizeof *all, rest = size % sizeof *all;
    bool made = all && !ferror(stdin) && rest == 0 && make_rays(rays, count);
    if (all && rest)
        fprintf(stderr, "hits: %zu bytes are left behind %zu rays: should be %zu bytes each\n",
                rest, count, sizeof *all);
    else if (!made)
        fprintf(stderr, "hits: the rays cannot be read, or memory is short\n");
    for (size_t i = 0; made && i < count; i++) {
        for (int k = 0; k < 3; k++) {
            rays->origin[k][i] = all[i][k];
            rays->direction[k][i] = all[i][3 + k];
        }
        rays->far[i] = all[i][6];
    }
    free(all);
    return made;
}

// Traces the rays by the phase; returns the time in ns.
static uint64_t time_phase(const struct prepared *prepared, const struct ray_arrays *rays,
                           bool any) {
    struct ray_set set = {.count = rays->count, .far = any ? rays->far : NULL, .any = any};
    for (int k = 0; k < 3; k++) {
        set.origin[k] = rays->origin[k];
        set.direction[k] = rays->direction[k];
    }
    set.t = rays->t[0];
    set.shape = rays->shape[0];
    uint64_t begin = timer_ns();
    phase_hits(prepared, &set);
    return timer_ns() - begin;
}

enum { TRACERS = 1 + EMBREE_MODES }; // the phase, and Embree in each mode

// Times the phase and Embree's modes in turns; each repetition starts with another one.
static bool measure(const struct prepared *prepared, struct ray_arrays *rays, struct embree *embree,
                    bool any, int reps, json_t *ns[TRACERS]) {
    int tracers = !embree ? 1 : embree_has_streams(embree) ? TRACERS : 1 + EMBREE_STREAM;
    for (int i = 0; i < reps; i++)
        for (int turn = 0; turn < tracers; turn++) {
            int tracer = (i + turn) % tracers;
            uint64_t elapsed =
                tracer == 0 ? time_phase(prepared, rays, any)
                            : embree_trace(embree, rays, any, (enum embree_mode)(tracer - 1));
            if (json_array_append_new(ns[tracer], json_integer((json_int_t)elapsed)) != 0)
                return false;
        }
    return true;
}

// Writes a temporary file and renames it, so that a failed write leaves `path` as it was.
static bool write_hits(const char *path, const struct ray_arrays *rays, bool both) {
    char temporary[PATH_MAX];
    int length = snprintf(temporary, sizeof temporary, "%s.%ld.tmp", path, (long)getpid());
    FILE *file = length < (int)sizeof temporary ? fopen(temporary, "wb") : NULL;
    if (!file)
        return false;
    bool written = true;
    for (int tracer = 0; tracer < 1 + both && written; tracer++)
        for (size_t i = 0; i < rays->count && written; i++) {
            float pair[2] = {rays->t[tracer][i], rays->shape[tracer][i]};
            written = fwrite(pair, sizeof pair, 1, file) == 1;
        }
    written = fclose(file) == 0 && written && rename(temporary, path) == 0;
    if (!written)
        remove(temporary);
    return written;
}

struct hits_options {
    const char *out;
    bool any, embree, coherent;
    int reps;
};

// Reads, traces and prints. Returns the exit status.
static int run(const struct scene *scene, const struct hits_options *options) {
    struct ray_arrays rays = {0};
    const char *reason = "not asked for", *out = options->out;
    bool any = options->any, coherent = options->coherent;
    int reps = options->reps;
    struct prepared *prepared = phase_prepare(&scene->model, 1);
    if (!prepared)
        fprintf(stderr, "hits: memory is short\n");
    if (!prepared || !read_rays(&rays)) {
        if (prepared)
            phase_release(prepared);
        return 2;
    }
    uint64_t begin = timer_ns();
    bool rebuilt = phase_update(prepared, &scene->model);
    uint64_t update_ns = timer_ns() - begin;
    begin = timer_ns();
    struct embree *embree =
        options->embree ? embree_create(&scene->model, coherent, &reason) : NULL;
    uint64_t embree_build_ns = timer_ns() - begin;
    json_t *ns[TRACERS] = {json_array(), json_array(), json_array(), json_array()};
    int status = 5;
    if (rebuilt && measure(prepared, &rays, embree, any, reps, ns)) {
        const char *said = phase_settings ? phase_settings(prepared) : "";
        json_t *record = json_pack(
            "{s:s, s:s, s:i, s:s, s:s, s:I, s:b, s:b, s:O, s:O, s:O, s:O, s:s, s:I, s:I}", "phase",
            phase_built.phase, "scene", scene->name, "lanes", variant_here().lanes, "isa",
            variant_here().isa, "settings", said, "count", (json_int_t)rays.count, "any", any,
            "coherent", coherent, "ns", ns[0], "embree16_ns", ns[1], "embree1_ns", ns[2],
            "embree_stream_ns", ns[3], "embree", embree ? embree_version(embree) : reason,
            "update_ns", (json_int_t)update_ns, "embree_build_ns", (json_int_t)embree_build_ns);
        status = out && !write_hits(out, &rays, embree != NULL) ? 2 : 0;
        if (status)
            fprintf(stderr, "hits: %s cannot be written\n", out);
        else
            status =
                record && json_dumpf(record, stdout, 0) == 0 && fputc('\n', stdout) != EOF ? 0 : 2;
        json_decref(record);
    }
    for (int i = 0; i < TRACERS; i++)
        json_decref(ns[i]);
    embree_destroy(embree);
    phase_release(prepared);
    free(rays.memory);
    return status;
}

int main(int argc, char **argv) {
    static const struct option known[] = {
        {"any", no_argument, 0, 'a'},          {"embree", no_argument, 0, 'e'},
        {"coherent", no_argument, 0, 'c'},     {"reps", required_argument, 0, 'r'},
        {"output", required_argument, 0, 'o'}, {0, 0, 0, 0}};
    struct hits_options options = {0};
    const char *missing = variant_missing(), *no;
    long reps = 1;
    for (int c; (c = getopt_long(argc, argv, "o:", known, NULL)) != -1;) {
        options.any = options.any || c == 'a';
        options.embree = options.embree || c == 'e';
        options.coherent = options.coherent || c == 'c';
        options.out = c == 'o' ? optarg : options.out;
        char *end = "";
        reps = c == 'r' ? strtol(optarg, &end, 10) : reps;
        if (reps < 1 || reps > MAX_REPS || *end != '\0')
            fprintf(stderr, "hits: --reps %s: should be a whole number from 1 to %d\n", optarg,
                    MAX_REPS);
        if (c == '?' || reps < 1 || reps > MAX_REPS || *end != '\0')
            return 2;
    }
    struct scene scene;
    char error[SCENE_ERROR_SIZE];
    if (optind + 1 != argc) {
        fprintf(
            stderr,
            "usage: hits SCENE.json [--any] [--embree] [--coherent] [--reps R] [-o FILE] <rays\n");
        return 2;
    }
    if (missing) {
        fprintf(stderr, "hits: the CPU lacks %s\n", missing);
        return 3;
    }
    if (!scene_load(argv[optind], NULL, &scene, error)) {
        fprintf(stderr, "hits: %s\n", error);
        return 2;
    }
    if (!(no = groups_unsupported(phase_built.groups, &scene)) && phase_unsupported)
        no = phase_unsupported(&scene);
    if (no)
        fprintf(stderr, "hits: %s\n", no);
    options.reps = (int)reps;
    int status = no ? 4 : run(&scene, &options);
    scene_free(&scene);
    return status;
}
