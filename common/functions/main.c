// The function bench (scripts/stepwise functions): bench list | errors | times | normalise | evaluate lists its entries,
// measures their errors and times, and evaluates an entry. Output is JSON, except for `evaluate`, which writes binary
// numbers.
#include <dlfcn.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "timing/timer.h"

enum { OK = 0, BAD_INPUT = 2, NO_TIMER = 3, OUT_OF_MEMORY = 5 };

static const struct entries *const FILES[] = {&scalar_float, &scalar_double, &sse_float,
                                              &sse_double,
#ifdef __x86_64__
                                              &avx2_float,   &avx2_double,   &avx512_float,
                                              &avx512_double
#endif
};
enum { FILE_COUNT = sizeof FILES / sizeof *FILES };

struct libraries {
    void *libmvec, *sleef;
};

// Checks whether an entry can run here, and finds its library function.
static struct runnable resolve_entry(const struct entries *of, const struct entry *entry,
                                     const struct libraries *libraries) {
    struct runnable one = {.of = of, .entry = entry};
    if (!runs_here(of))
        one.missing = "the CPU lacks the instruction set";
    else if (entry->symbol) {
        bool sleef = entry->symbol[0] == 'S';
        void *library = sleef ? libraries->sleef : libraries->libmvec;
        void *found = library ? dlsym(library, entry->symbol) : NULL;
        memcpy(&one.external, &found, sizeof found); // ISO C has no cast from void * to a function
        if (!library)
            one.missing = sleef ? "libsleef.so.3 is not installed" : "libmvec.so.1 is not here";
        else if (!found)
            one.missing = sleef ? "this SLEEF lacks the function" : "this glibc lacks the function";
    }
    return one;
}

static void print_list(const struct runnable *all, size_t count) {
    printf("{\"mpfr\": %s, \"entries\": [", has_mpfr ? "true" : "false");
    for (size_t i = 0; i < count; i++) {
        const struct runnable *one = &all[i];
        const struct target *target = find_target(one->entry->function);
        printf("%s\n{\"id\": %zu, \"function\": \"%s\", \"family\": \"%s\", \"name\": \"%s\", "
               "\"isa\": \"%s\", \"bits\": %d, \"precision\": \"%s\", \"arguments\": %d, "
               "\"missing\": ",
               i ? "," : "", i, one->entry->function, one->entry->family, one->entry->name,
               one->of->isa, one->of->bits, one->of->is_double ? "double" : "float",
               target ? target->arguments : 1);
        printf(one->missing ? "\"%s\"}" : "null}", one->missing);
    }
    printf("]}\n");
}

static void print_number(const char *name, double value) {
    if (isfinite(value))
        printf(", \"%s\": %.17g", name, value);
    else
        printf(", \"%s\": null", name);
}

static bool print_errors(const struct runnable *all, size_t count,
                         const struct settings *settings) {
    struct error *errors = calloc(count, sizeof *errors);
    bool ok = errors && measure_exhaustive(all, count, settings, errors) &&
              measure_sampled(all, count, settings, errors);
    if (ok)
        printf("{\"entries\": [");
    for (size_t i = 0; ok && i < count; i++) {
        const struct error *e = &errors[i];
        printf("%s\n{\"id\": %zu, \"count\": %" PRIu64 ", \"non_finite\": %" PRIu64, i ? "," : "",
               i, e->count, e->non_finite);
        if (e->count) {
            print_number("max_ulp", e->largest);
            // The order of the threads changes the digits beyond these.
            printf(", \"rms_ulp\": %.9g",
                   e->count > e->non_finite
                       ? sqrt(e->sum_of_squares / (double)(e->count - e->non_finite))
                       : 0.0);
            print_number("worst_a", e->worst_a);
            print_number("worst_b", e->worst_b);
        }
        printf("}");
    }
    if (ok)
        printf("]}\n");
    free(errors);
    return ok;
}

// Reads arguments from standard input: all a, then all b if the function has two. They are floats or
// doubles, a multiple of 16 of each. Writes the results to standard output.
static int evaluate(const struct runnable *one) {
    size_t size = one->of->is_double ? 8 : 4, room = 1 << 20, length = 0;
    const struct target *target = find_target(one->entry->function);
    size_t arguments = target ? (size_t)target->arguments : 1;
    char *in = malloc(room);
    for (size_t got; in && (got = fread(in + length, 1, room - length, stdin)) > 0;) {
        length += got;
        if (length == room) {
            char *more = realloc(in, room *= 2);
            if (!more)
                free(in);
            in = more;
        }
    }
    char *out = in ? malloc(length / arguments + 1) : NULL;
    int status = OUT_OF_MEMORY;
    if (!out)
        fprintf(stderr, "functions: out of memory\n");
    else {
        size_t n = length / size / arguments;
        one->entry->stream(one->external, n, in, in + n * size, out);
        status = fwrite(out, size, n, stdout) == n && fflush(stdout) == 0 ? OK : 1;
    }
    free(out);
    free(in);
    return status;
}

struct options {
    struct settings settings;
    uint64_t id;
};

// Reads the options that scripts/stepwise functions gives: --quick, --threads T, --rounds R, --vectors N, --seed S, --id ID.
static void parse(int argc, char **argv, struct options *options) {
    struct settings *settings = &options->settings;
    for (int i = 2; i < argc; i++) {
        const char *name = argv[i];
        if (strcmp(name, "--quick") == 0) {
            settings->quick = true;
            continue;
        }
        uint64_t value = i + 1 < argc ? strtoull(argv[++i], NULL, 10) : 0;
        if (strcmp(name, "--threads") == 0)
            settings->threads = (int)value;
        else if (strcmp(name, "--rounds") == 0)
            settings->rounds = (int)value;
        else if (strcmp(name, "--vectors") == 0)
            settings->vectors = value / 16 * 16;
        else if (strcmp(name, "--seed") == 0)
            settings->seed = value;
        else
            options->id = value;
    }
}

static int run_command(const char *command, const struct runnable *all, size_t count,
                       const struct options *options) {
    const struct settings *settings = &options->settings;
    bool ok = true;
    if (strcmp(command, "list") == 0)
        print_list(all, count);
    else if (strcmp(command, "errors") == 0)
        ok = print_errors(all, count, settings);
    else if (strcmp(command, "times") == 0 && !timer_missing())
        ok = print_times(all, count, settings);
    else if (strcmp(command, "times") == 0) {
        fprintf(stderr, "functions: the CPU lacks %s\n", timer_missing());
        return NO_TIMER;
    } else if (strcmp(command, "normalise") == 0)
        ok = print_normalise(FILES, FILE_COUNT, settings);
    else if (strcmp(command, "evaluate") == 0) {
        const struct runnable *one = &all[options->id];
        if (!one->missing)
            return evaluate(one);
        fprintf(stderr, "functions: %s: %s\n", one->entry->name, one->missing);
        return BAD_INPUT;
    }
    if (!ok)
        fprintf(stderr, "functions: out of memory\n");
    return ok ? OK : OUT_OF_MEMORY;
}

int main(int argc, char **argv) {
    size_t count = 0;
    for (size_t f = 0; f < FILE_COUNT; f++)
        count += FILES[f]->count;
    struct options options = {
        .settings = {.threads = 1, .rounds = 11, .seed = 1, .vectors = 20000000}};
    parse(argc, argv, &options);
    struct runnable *all = calloc(count, sizeof *all);
    if (!all) {
        fprintf(stderr, "functions: out of memory\n");
        return OUT_OF_MEMORY;
    }
    struct libraries libraries = {dlopen("libmvec.so.1", RTLD_NOW),
                                  dlopen("libsleef.so.3", RTLD_NOW)};
    size_t i = 0;
    for (size_t f = 0; f < FILE_COUNT; f++)
        for (size_t k = 0; k < FILES[f]->count; k++)
            all[i++] = resolve_entry(FILES[f], &FILES[f]->entry[k], &libraries);
    int status = run_command(argc > 1 ? argv[1] : "list", all, count, &options);
    free(all);
    if (libraries.sleef)
        dlclose(libraries.sleef);
    if (libraries.libmvec)
        dlclose(libraries.libmvec);
    return status;
}
