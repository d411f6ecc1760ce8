// The driver's command line.
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "driver/driver.h"

enum { MAX_FRAMES = 1000000, MAX_SIDE = 32768, MAX_PIXELS = 1 << 28 };

static const char USAGE[] =
    "usage: render SCENE.json -n HEIGHT [options]\n"
    "  -n HEIGHT, --height   picture height in pixels\n"
    "  -w WIDTH, --width     default: round(HEIGHT*16/9)\n"
    "  -o FILE               write the picture of the exact camera: .exr (float, linear RGB), or\n"
    "                        as displayed (gamma, 8 bits) .png or .ppm\n"
    "  --aov                 .exr with depth, shape id, normal and evaluation count per pixel\n"
    "  --samples K           each pixel is the mean of K x K rays, in linear light: a picture K\n"
    "                        times as wide and high is drawn, and timed, and averaged\n"
    "  --display             only the picture as displayed; some phases make it themselves\n"
    "  --threads T           default 1\n"
    "  --reps R              timed frames, default 1; the camera turns by pixels in between\n"
    "  --frames N            an animation instead: frame k < N is at k/60 s, shapes and the\n"
    "                        camera follow their paths; -o writes the first frame\n"
    "  --first-frame K       start it at frame K: frames K to N-1 are drawn\n"
    "  --warmup K            frames before the timed ones, marked as warm-up, default 0\n"
    "  --hit-distance X      replaces the scene's value (recorded)\n"
    "  --max-steps K         replaces the scene's value (recorded)\n"
    "  --json | --jsonl      one JSON object, or one JSON line per frame, on standard output\n"
    "  --list                print the phases with their titles and ideas\n"
    "exit status: 0 done; 2 bad argument, scene or output; 3 the CPU lacks the instruction set;\n"
    "             4 the phase does not support this scene or option; 5 out of memory\n";

// Reads a whole number from `least` to `most`; false if `text` is anything else.
static bool parse_whole(const char *text, long least, long most, int *out) {
    char *end;
    errno = 0;
    long value = strtol(text, &end, 10);
    if (errno || end == text || *end || value < least || value > most)
        return false;
    *out = (int)value;
    return true;
}

bool driver_ends_in(const char *name, const char *ending) {
    size_t length = strlen(name);
    return length >= 5 && strcasecmp(name + length - 4, ending) == 0;
}

// Returns whether the picture's file has a name that says what it can hold.
static bool can_hold(const struct options *o) {
    bool bytes = driver_ends_in(o->out, ".png") || driver_ends_in(o->out, ".ppm");
    return o->aov ? driver_ends_in(o->out, ".exr")
                  : bytes || (!o->display && driver_ends_in(o->out, ".exr"));
}

// Checks the options against each other and fills in defaults. Each alone has a valid value.
static int check_combination(int argc, char **argv, struct options *o) {
    if (optind + 1 != argc)
        return driver_error(BAD_INPUT, "exactly one SCENE.json is required; see render -h");
    o->scene = argv[optind];
    if (o->height == 0)
        return driver_error(BAD_INPUT, "-n HEIGHT is required; see render -h");
    if (o->json && o->jsonl)
        return driver_error(BAD_INPUT, "--json and --jsonl exclude each other");
    if (o->display && o->aov)
        return driver_error(BAD_INPUT, "--display and --aov exclude each other");
    if (o->samples > 1 && o->aov)
        return driver_error(BAD_INPUT, "--samples and --aov exclude each other: a depth or a shape "
                                       "has no mean");
    if (o->out && !can_hold(o))
        return driver_error(BAD_INPUT, "-o: a name that ends in %s is required, not \"%s\"",
                            o->aov       ? ".exr"
                            : o->display ? ".png or .ppm"
                                         : ".exr, .png or .ppm",
                            o->out);
    if (o->frames && o->reps)
        return driver_error(BAD_INPUT, "--frames and --reps exclude each other");
    if (o->first_frame && !o->frames)
        return driver_error(BAD_INPUT,
                            "--first-frame needs --frames: give the animation's length too");
    if (o->first_frame && o->first_frame >= o->frames)
        return driver_error(BAD_INPUT,
                            "--first-frame %d needs --frames %d or more: frames are counted from 0",
                            o->first_frame, o->first_frame + 1);
    if (!o->frames && !o->reps)
        o->reps = 1;
    if (o->width == 0)
        o->width = (int)lround(o->height * 16.0 / 9.0);
    long side = o->samples, all = (long)o->width * o->height * side * side;
    if (all > MAX_PIXELS || o->width * side > MAX_SIDE || o->height * side > MAX_SIDE)
        return driver_error(BAD_INPUT,
                            "%ld x %ld pixels%s; at most %d a side and %d in all are allowed",
                            o->width * side, o->height * side, side > 1 ? " with --samples" : "",
                            MAX_SIDE, MAX_PIXELS);
    return OK;
}

enum {
    AOV = 256,
    THREADS,
    REPS,
    WARMUP,
    HIT,
    STEPS,
    JSON,
    JSONL,
    LIST,
    FRAMES,
    FIRST,
    DISPLAY,
    SAMPLES
};
static const struct option KNOWN_OPTIONS[] = {{"height", required_argument, 0, 'n'},
                                              {"width", required_argument, 0, 'w'},
                                              {"output", required_argument, 0, 'o'},
                                              {"aov", no_argument, 0, AOV},
                                              {"display", no_argument, 0, DISPLAY},
                                              {"samples", required_argument, 0, SAMPLES},
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

// Options whose value is a whole number: what is required, and where it is kept.
static const struct {
    int option, least, most;
    const char *wanted;
    size_t at;
} WHOLE[] = {
    {'n', 1, MAX_SIDE, "-n: a height of 1 to 32768 pixels", offsetof(struct options, height)},
    {'w', 1, MAX_SIDE, "-w: a width of 1 to 32768 pixels", offsetof(struct options, width)},
    {THREADS, 1, 4096, "--threads: 1 to 4096", offsetof(struct options, threads)},
    {SAMPLES, 1, 64, "--samples: 1 to 64", offsetof(struct options, samples)},
    {REPS, 1, 1000000, "--reps: 1 to 1000000", offsetof(struct options, reps)},
    {WARMUP, 0, 1000000, "--warmup: 0 to 1000000", offsetof(struct options, warmup)},
    {FRAMES, 1, MAX_FRAMES, "--frames: 1 to 1000000", offsetof(struct options, frames)},
    {FIRST, 0, MAX_FRAMES, "--first-frame: 0 to 1000000", offsetof(struct options, first_frame)},
    {STEPS, 1, 1000000000, "--max-steps: 1 to 1000000000",
     offsetof(struct options, overrides.max_steps)},
};

// Stores an option's value in `o`. Returns NULL, or the text of what is required instead.
static const char *parse_value(int option, const char *value, struct options *o) {
    double *hit = &o->overrides.hit_distance;
    char *end;
    if (option == 'o')
        o->out = value;
    for (size_t i = 0; i < sizeof WHOLE / sizeof *WHOLE; i++)
        if (WHOLE[i].option == option &&
            !parse_whole(value, WHOLE[i].least, WHOLE[i].most, (int *)((char *)o + WHOLE[i].at)))
            return WHOLE[i].wanted;
    if (option != HIT)
        return NULL;
    *hit = strtod(value, &end);
    bool good = end != value && !*end && *hit >= 1e-9 && *hit <= 1e9;
    return good ? NULL : "--hit-distance: a length of 1e-9 to 1e9";
}

int driver_parse(int argc, char **argv, struct options *o) {
    *o = (struct options){.threads = 1, .samples = 1};
    opterr = 0;
    for (int c; (c = getopt_long(argc, argv, ":n:w:o:h", KNOWN_OPTIONS, NULL)) != -1;) {
        const char *wanted = NULL;
        switch (c) {
        case AOV: o->aov = true; break;
        case DISPLAY: o->display = true; break;
        case JSON: o->json = true; break;
        case JSONL: o->jsonl = true; break;
        case LIST: return driver_list_phases();
        case 'h': fputs(USAGE, stdout); return -1;
        case ':': return driver_error(BAD_INPUT, "%s: a value is required", argv[optind - 1]);
        case '?':
            // A short option, which may stand among others in one word.
            if (optopt > 0 && optopt < AOV && optopt != 'h')
                return driver_error(BAD_INPUT, "-%c: unknown option; see render -h", optopt);
            return driver_error(BAD_INPUT, "%s: unknown option; see render -h", argv[optind - 1]);
        default: wanted = parse_value(c, optarg, o);
        }
        if (wanted)
            return driver_error(BAD_INPUT, "%s is required, not \"%s\"", wanted, optarg);
    }
    return check_combination(argc, argv, o);
}
