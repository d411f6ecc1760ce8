// What the files of the driver share: options, the session, and the functions of each file.
#pragma once

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#include "driver/errors.h"
#include "driver/variant.h"
#include "frame/frame.h"
#include "phase.h"
#include "scene/scene.h"

struct options {
    const char *scene, *out; // paths
    int height, width, threads, reps, warmup;
    int frames, first_frame; // of an animation; 0 frames: a still picture
    int samples;             // each pixel is the mean of samples × samples rays
    bool aov, display, json, jsonl;
    struct scene_overrides overrides;
};

// Counters of the operating system. Only differences of two readings have a meaning, except for
// max_rss_kib, the peak of resident memory.
struct conditions {
    long steal_ticks, ctx_voluntary, ctx_involuntary, faults_minor, faults_major, max_rss_kib;
};

// What the build fixed (driver/variant.h), and what runs.
struct program {
    const char *phase, *flags_from, *precision, *compiler;
    struct variant variant;
};

// One run of the program. Times are nanoseconds, clocks Hz, the overhead timer cycles.
struct session {
    struct options options;
    struct scene scene;
    struct model moving; // the scene's model with the shapes where the current frame has them
    struct prepared *prepared;
    struct frame frame;    // what the phase draws
    struct frame averaged; // with --samples: its means
    struct presenter *presenter;
    struct program program;
    uint8_t *rgb8; // the displayed picture; NULL if the phase itself writes frame.shown
    double tsc_hz, core_hz_load;
    uint64_t overhead, prepare_ns;
    json_t *frames; // with --json: one record per frame
};

// What was measured around one frame. Times are nanoseconds, tsc is timer cycles, clocks are Hz,
// scene_time is seconds of the animation.
struct measured {
    struct conditions before, after;
    double core_before, core_after, scene_time;
    uint64_t ns, tsc, update_ns, present_ns;
};

// options.c: parses the command line into `o` and checks it. Returns OK, an error's exit status
// after printing the error, or −1 if the arguments were --help or --list and are answered.
int driver_parse(int argc, char **argv, struct options *o);

// options.c: whether the file's name has a stem and that ending of four characters, in either case.
bool driver_ends_in(const char *name, const char *ending);

// warnings.c: prints a line on standard error for each thing in the prepared scene that its picture cannot show.
void driver_warn(const struct session *s);

// phases.c: prints a line for each phase (--list). Returns −1, or BAD_INPUT after printing an error.
int driver_list_phases(void);

// conditions.c: the counters now. A counter that the system does not provide is 0.
struct conditions driver_conditions(void);
// conditions.c: the CPU that this process is pinned to, −1 if it may run on several.
int driver_cpu(void);

// record.c: a new JSON object with what all frames have in common, NULL if memory is short. The
// fields are listed in results/README.md. The caller releases it.
json_t *driver_header(const struct session *s);
// record.c: a new JSON object with the measurements of frame `index`, NULL if memory is short.
// `first`: the first frame that this process renders, warm-up included.
json_t *driver_record(const struct measured *m, const struct session *s, int index, bool warmup,
                      bool first);
// record.c: prints the object on a line of standard output and releases it. Returns false if
// `object` is NULL or the line could not be written.
bool driver_print(json_t *object);
