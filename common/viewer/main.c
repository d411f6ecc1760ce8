// build/viewer: options, then the window or --headless.
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "viewer/show.h"
#include "viewer/viewer.h"
#include "workers/cpus.h"

static const char USAGE[] =
    "usage: viewer [SCENE] [options]      SCENE: a file, or a name of common/scenes; default "
    "scene0\n"
    "  --phase NAME        default: the last of the ladder that draws the scene\n"
    "  --reference NAME    what it is compared with, default: opt3 or the next before it\n"
    "  --threads T         default: the CPUs that this process may run on\n"
    "  --size WxH          of the window or the pictures, default 1280x720\n"
    "  --script FILE       play a camera path: a JSON object a line (docs/view.md)\n"
    "  --headless -o DIR   render the script's frames to DIR/00000.png ..., without a window\n"
    "  --list              print the phases that run here\n"
    "exit status: 0 done; 2 bad argument, scene, script or no display; 3 the CPU lacks the\n"
    "             instruction set; 4 the phase does not support the scene; 5 out of memory\n";

static int cpus_here(void) {
    struct cpus cpus = {0};
    int count = cpus_get(&cpus) == 0 ? CPU_COUNT_S(cpus.size, cpus.set) : 1;
    cpus_free(&cpus);
    return count;
}

static bool parse_range(const char *text, int least, int most, int *out, char stop) {
    char *end;
    long value = strtol(text, &end, 10);
    *out = (int)value;
    return end != text && *end == stop && value >= least && value <= most;
}

// Returns what is required instead of the option's value, NULL if the value is good.
static const char *take(int option, const char *value, struct viewer_options *o) {
    const char *x;
    switch (option) {
    case 'p': o->phase = value; break;
    case 'r': o->reference = value; break;
    case 's': o->script = value; break;
    case 'o': o->out = value; break;
    case 't': return parse_range(value, 1, 4096, &o->threads, '\0') ? NULL : "--threads: 1 to 4096";
    case 'z':
        x = strchr(value, 'x');
        return x && parse_range(value, 64, 8192, &o->width, 'x') &&
                       parse_range(x + 1, 36, 8192, &o->height, '\0')
                   ? NULL
                   : "--size: a size of 64x36 to 8192x8192";
    }
    return NULL;
}

static int list(void) {
    for (int i = 0; i < phases_count(); i++)
        if (!phases_at(i)->missing())
            printf("%s\n", phases_at(i)->name);
    return -1;
}

// Returns OK, an error's exit status, or -1 if the arguments are answered.
static int parse(int argc, char **argv, struct viewer_options *o) {
    enum { HEADLESS = 256, LIST };
    static const struct option known[] = {
        {"phase", required_argument, 0, 'p'},   {"reference", required_argument, 0, 'r'},
        {"script", required_argument, 0, 's'},  {"output", required_argument, 0, 'o'},
        {"threads", required_argument, 0, 't'}, {"size", required_argument, 0, 'z'},
        {"headless", no_argument, 0, HEADLESS}, {"list", no_argument, 0, LIST},
        {"help", no_argument, 0, 'h'},          {0, 0, 0, 0}};
    *o = (struct viewer_options){
        .scene = "scene0", .width = 1280, .height = 720, .threads = cpus_here()};
    opterr = 0;
    for (int c; (c = getopt_long(argc, argv, ":o:h", known, NULL)) != -1;) {
        const char *wanted;
        switch (c) {
        case HEADLESS: o->headless = true; break;
        case LIST: return list();
        case 'h': fputs(USAGE, stdout); return -1;
        case ':': return viewer_error(BAD_INPUT, "%s: a value is required", argv[optind - 1]);
        case '?':
            return viewer_error(BAD_INPUT, "%s: unknown option; see viewer -h", argv[optind - 1]);
        default:
            wanted = take(c, optarg, o);
            if (wanted)
                return viewer_error(BAD_INPUT, "%s is required, not \"%s\"", wanted, optarg);
        }
    }
    if (optind + 1 < argc)
        return viewer_error(BAD_INPUT, "at most one SCENE is allowed; see viewer -h");
    if (optind < argc)
        o->scene = argv[optind];
    if (o->headless && (!o->script || !o->out))
        return viewer_error(BAD_INPUT, "--headless needs --script FILE and -o DIR");
    return OK;
}

// Opens the named phase, or the ladder's last that draws the scene.
static int open_phase(const char *name, const struct world *world, struct show *show) {
    char error[SCENE_ERROR_SIZE] = "no phase is linked";
    int index = name ? phases_find(name) : -1;
    if (name && index < 0)
        return viewer_error(BAD_INPUT, "--phase: \"%s\" is no phase here; viewer --list", name);
    if (name && phases_at(index)->missing()) {
        stage_open(&show->left, phases_at(index), world, show->threads, error);
        return viewer_error(NO_ISA, "%s", error);
    }
    if (name)
        return show_open(show, phases_at(index), world, error)
                   ? OK
                   : viewer_error(UNSUPPORTED, "%s: %s", world->path, error);
    for (int number = 99; number >= 0; number--) {
        int at = phases_of_number(number);
        if (at >= 0 && show_open(show, phases_at(at), world, error))
            return OK;
    }
    for (int i = 0; i < phases_count(); i++)
        if (show_open(show, phases_at(i), world, error))
            return OK;
    return viewer_error(UNSUPPORTED, "%s: %s", world->path, error);
}

// The default is the fastest phase in double precision that this CPU can run.
static int choose_reference(const char *name, const struct world *world, struct show *show) {
    int index = name ? phases_find(name) : -1;
    if (name && index < 0)
        return viewer_error(BAD_INPUT, "--reference: \"%s\" is no phase here; viewer --list", name);
    for (int number = 3; !name && index < 0 && number >= 0; number--) {
        int at = phases_of_number(number);
        if (at >= 0 && !phases_at(at)->missing() && !why_unsupported(phases_at(at), &world->scene))
            index = at;
    }
    show->reference = index >= 0 ? phases_at(index) : show->left.phase;
    return OK;
}

static int run(const struct viewer_options *options, struct show *show) {
    char error[SCENE_ERROR_SIZE];
    const struct world *world = world_open(options->scene, error);
    if (!world)
        return viewer_error(BAD_INPUT, "%s", error);
    if (!show_create(show, options->width, options->height, options->threads))
        return viewer_error(NO_MEMORY, "out of memory");
    int status = open_phase(options->phase, world, show);
    if (status == OK)
        status = choose_reference(options->reference, world, show);
    if (status != OK)
        return status;
    return options->headless ? headless_run(options, show) : window_run(options, show);
}

int main(int argc, char **argv) {
    struct viewer_options options;
    struct show show = {0};
    phases_sort();
    int status = parse(argc, argv, &options);
    if (status != OK)
        return status < 0 ? OK : status;
    status = run(&options, &show);
    show_free(&show);
    worlds_free();
    return status;
}
