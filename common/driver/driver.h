// What the driver's parts share: its arguments, a session, and what is said of a frame.
#ifndef STEPWISE_DRIVER_H
#define STEPWISE_DRIVER_H

#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

#include "driver/variant.h"
#include "frame/frame.h"
#include "phase.h"
#include "scene/scene.h"

enum status { OK = 0, BAD_INPUT = 2, NO_ISA = 3, UNSUPPORTED = 4, NO_MEMORY = 5 };

struct options {
    const char *scene, *out;
    int height, width, threads, reps, warmup;
    int frames, first_frame; // of an animation; 0 frames: a still picture
    bool aov, display, json, jsonl;
    struct scene_overrides overrides;
};

// What the operating system says of this process and machine, to be taken as differences.
struct conditions {
    long steal_ticks, ctx_voluntary, ctx_involuntary, faults_minor, faults_major, max_rss_kib;
};

// What is built in: phase_info.h.
struct program {
    const char *phase, *flags_from, *precision, *compiler;
    struct variant variant;
};

struct session {
    struct options options;
    struct scene scene;
    struct model moving; // the scene's, with shapes where a frame of an animation has them
    struct prepared *prepared;
    struct frame frame;
    struct presenter *presenter;
    struct program program;
    uint8_t *rgb8; // NULL where the phase makes the picture as it is displayed: frame.shown
    double tsc_hz, core_hz_load;
    uint64_t overhead, prepare_ns;
    json_t *frames;
};

// What a frame is, beside the picture that it leaves.
struct measured {
    struct conditions before, after;
    double core_before, core_after, scene_time;
    uint64_t ns, tsc, update_ns, present_ns;
};

// driver_options.c
// A line on standard error; returns `status`.
int driver_complain(int status, const char *format, ...) __attribute__((format(printf, 2, 3)));
// What was printed so far has arrived, or that is the error.
int driver_flush(void);
// Parses into `o`; returns OK, or the status to exit with (−1: --help or --list was served).
int driver_parse(int argc, char **argv, struct options *o);

// driver_phases.c: --list. The status to exit with; −1: served.
int driver_list_phases(void);

// driver_conditions.c
struct conditions driver_conditions(void);
int driver_cpu(void); // the only one that this process may run on; −1: there are several

// driver_record.c: JSON objects; NULL: out of memory.
json_t *driver_header(const struct session *s);
json_t *driver_record(const struct measured *m, const struct session *s, int index, bool warmup,
                      bool first);
bool driver_print(json_t *object); // and releases it; false: not there, or not written

#endif
