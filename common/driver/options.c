// The driver's arguments, and its words when one is wrong.
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "driver/driver.h"

enum { MOST_FRAMES = 1000000, LARGEST_SIDE = 32768, LARGEST_PIXELS = 1 << 28 };

static const char USAGE[] =
    "usage: render SCENE.json -n HEIGHT [options]\n"
    "  -n HEIGHT, --height   picture height in pixels\n"
    "  -w WIDTH, --width     default: round(HEIGHT*16/9)\n"
    "  -o FILE.exr           write the picture of the exact camera (float, linear RGB)\n"
    "  --aov                 with depth, shape id, normal and evaluation count per pixel\n"
    "  --display             the picture as displayed alone (gamma, 8 bits), by the phase itself "
    "if it "
    "can;\n"
    "                        -o writes it as a binary PPM\n"
    "  --threads T           default 1\n"
    "  --reps R              timed frames, default 1; all but the first are moved by a hair\n"
    "  --frames N            an animation of N frames in place of those: frame k is at k/60 s, "
    "shapes\n"
    "                        follow their paths, the camera stays; -o writes the first of them\n"
    "  --first-frame K       goes on with the animation's frame K: after an interruption\n"
    "  --warmup K            frames before those, marked as warm-up, default 0\n"
    "  --hit-distance X      in place of the scene's own (recorded)\n"
    "  --max-steps K         in place of the scene's own (recorded)\n"
    "  --json | --jsonl      one JSON object, or one JSON line per frame, on standard output\n"
    "  --list                the phases and what they are\n"
    "exit status: 0 done; 2 bad argument, scene or output; 3 the CPU lacks the instruction set;\n"
    "             4 the phase does not support this scene or option; 5 out of memory\n";

int driver_complain(int status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fputs("render: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return status;
}

int driver_flush(void) {
    if (fflush(stdout) != 0 || ferror(stdout))
        return driver_complain(BAD_INPUT, "standard output cannot be written: %s", strerror(errno));
    return OK;
}

static bool whole_number(const char *text, long least, long most, int *out) {
    char *end;
    errno = 0;
    long value = strtol(text, &end, 10);
    if (errno || end == text || *end || value < least || value > most)
        return false;
    *out = (int)value;
    return true;
}

// What each option says by itself is right.
static int good_together(int argc, char **argv, struct options *o) {
    if (optind + 1 != argc)
        return driver_complain(BAD_INPUT, "exactly one SCENE.json is required; see render -h");
    o->scene = argv[optind];
    if (o->height == 0)
        return driver_complain(BAD_INPUT, "-n HEIGHT is required; see render -h");
    if (o->json && o->jsonl)
        return driver_complain(BAD_INPUT, "--json and --jsonl exclude each other");
    const char *ending = o->display ? ".ppm" : ".exr";
    size_t length = o->out ? strlen(o->out) : 0;
    if (o->out && (length < 5 || strcasecmp(o->out + length - 4, ending) != 0))
        return driver_complain(BAD_INPUT, "-o: a name that ends in %s is required, not \"%s\"%s",
                               ending, o->out, o->display ? "" : " (of 8 bits: --display, .ppm)");
    if (o->display && o->aov)
        return driver_complain(BAD_INPUT, "--display and --aov exclude each other");
    if (o->frames && o->reps)
        return driver_complain(BAD_INPUT, "--frames and --reps exclude each other");
    if (o->first_frame && !o->frames)
        return driver_complain(BAD_INPUT,
                               "--first-frame is of --frames: give the animation's length too");
    if (o->first_frame && o->first_frame >= o->frames)
        return driver_complain(BAD_INPUT,
                               "--first-frame %d: an animation of %d frames ends with frame %d",
                               o->first_frame, o->frames, o->frames - 1);
    if (!o->frames && !o->reps)
        o->reps = 1;
    if (o->width == 0)
        o->width = (int)lround(o->height * 16.0 / 9.0);
    if ((long)o->width * o->height > LARGEST_PIXELS)
        return driver_complain(BAD_INPUT, "%d x %d pixels; at most %d pixels are allowed", o->width,
                               o->height, LARGEST_PIXELS);
    return OK;
}

enum { AOV = 256, THREADS, REPS, WARMUP, HIT, STEPS, JSON, JSONL, LIST, FRAMES, FIRST, DISPLAY };
static const struct option known[] = {{"height", required_argument, 0, 'n'},
                                      {"width", required_argument, 0, 'w'},
                                      {"output", required_argument, 0, 'o'},
                                      {"aov", no_argument, 0, AOV},
                                      {"display", no_argument, 0, DISPLAY},
                                      {"threads", required_argument, 0, THREADS},
                                      {"reps", required_argument, 0, REPS},
                                      {"warmup", required_argument, 0, WARMUP},
                                      {"frames", required_argument, 0, FRAMES},
                                      {"first-frame", required_argument, 0, FIRST},
                                      {"hit-distance", required_argument, 0, HIT},
                                      {"max-steps", required_argument, 0, STEPS},
                                      {"json", no_argument, 0, JSON},
                                      {"jsonl", no_argument, 0, JSONL},
                                      {"list", no_argument, 0, LIST},
                                      {"help", no_argument, 0, 'h'},
                                      {0, 0, 0, 0}};

// The value of an option that has one, into `o`. NULL, or what is required in its place.
static const char *take(int option, const char *value, struct options *o) {
    bool good = true;
    char *end;
    const char *wanted = "";
    switch (option) {
    case 'n':
        good = whole_number(value, 1, LARGEST_SIDE, &o->height);
        wanted = "-n: a height of 1 to 32768 pixels";
        break;
    case 'w':
        good = whole_number(value, 1, LARGEST_SIDE, &o->width);
        wanted = "-w: a width of 1 to 32768 pixels";
        break;
    case 'o': o->out = value; break;
    case THREADS:
        good = whole_number(value, 1, 4096, &o->threads);
        wanted = "--threads: 1 to 4096";
        break;
    case REPS:
        good = whole_number(value, 1, 1000000, &o->reps);
        wanted = "--reps: 1 to 1000000";
        break;
    case WARMUP:
        good = whole_number(value, 0, 1000000, &o->warmup);
        wanted = "--warmup: 0 to 1000000";
        break;
    case FRAMES:
        good = whole_number(value, 1, MOST_FRAMES, &o->frames);
        wanted = "--frames: 1 to 1000000";
        break;
    case FIRST:
        good = whole_number(value, 0, MOST_FRAMES, &o->first_frame);
        wanted = "--first-frame: 0 to 1000000";
        break;
    case HIT:
        o->overrides.hit_distance = strtod(value, &end);
        good = end != value && !*end && o->overrides.hit_distance >= 1e-9 &&
               o->overrides.hit_distance <= 1e9;
        wanted = "--hit-distance: a length of 1e-9 to 1e9";
        break;
    case STEPS:
        good = whole_number(value, 1, 1000000000, &o->overrides.max_steps);
        wanted = "--max-steps: 1 to 1000000000";
        break;
    }
    return good ? NULL : wanted;
}

int driver_parse(int argc, char **argv, struct options *o) {
    *o = (struct options){.threads = 1};
    opterr = 0;
    for (int c; (c = getopt_long(argc, argv, ":n:w:o:h", known, NULL)) != -1;) {
        const char *wanted = NULL;
        switch (c) {
        case AOV: o->aov = true; break;
        case DISPLAY: o->display = true; break;
        case JSON: o->json = true; break;
        case JSONL: o->jsonl = true; break;
        case LIST: return driver_list_phases();
        case 'h': fputs(USAGE, stdout); return -1;
        case ':': return driver_complain(BAD_INPUT, "%s: a value is required", argv[optind - 1]);
        case '?':
            if (optopt > 0 && optopt < AOV &&
                optopt != 'h') // one letter, maybe of several in a word
                return driver_complain(BAD_INPUT, "-%c: unknown option; see render -h", optopt);
            return driver_complain(BAD_INPUT, "%s: unknown option; see render -h",
                                   argv[optind - 1]);
        default: wanted = take(c, optarg, o);
        }
        if (wanted)
            return driver_complain(BAD_INPUT, "%s is required, not \"%s\"", wanted, optarg);
    }
    return good_together(argc, argv, o);
}
