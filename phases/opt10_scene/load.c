// A scene's kernel: found in the cache or made, checked, loaded.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "kernel.h"

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

// What the kernel is told by: its source, its flags, and the compiler, by the file it is.
static void name_kernel(const char *source, const char *flags, int lanes, const char *compiler,
                        char tag[17]) {
    char real[4096];
    struct stat file = {0};
    const char *path = realpath(compiler, real) ? real : compiler;
    if (stat(path, &file) != 0)
        file.st_size = 0;
    const long long facts[] = {lanes, (long long)file.st_size, (long long)file.st_mtim.tv_sec,
                               (long long)file.st_mtim.tv_nsec, (long long)file.st_ino};
    unsigned long long hash = fnv(FNV_BEGIN, source, strlen(source) + 1);
    hash = fnv(hash, flags, strlen(flags) + 1);
    hash = fnv(hash, path, strlen(path) + 1);
    snprintf(tag, 17, "%016llx", fnv(hash, facts, sizeof facts));
}

// Under a name of this process's own, then renamed: who reads it finds all of it or nothing.
static bool make_object(const char *source, const char *folder, const char *compiler,
                        const char *flags, int lanes, const char *tag, const char *object,
                        char reason[256]) {
    char text[4400], made[4400], kept[4400];
    snprintf(text, sizeof text, "%s/.%s-XXXXXX.c", folder, tag);
    snprintf(kept, sizeof kept, "%s/%s.c", folder, tag);
    cache_sweep(folder);
    int opened =
        mkostemps(text, 2, O_CLOEXEC); // not by a process's number: containers may share the folder
    FILE *file = opened < 0 ? NULL : fdopen(opened, "w");
    if (opened >= 0 && !file)
        close(opened);
    bool done = file && fputs(source, file) >= 0;
    done = file && fclose(file) == 0 && done;
    snprintf(made, sizeof made, "%.*s.so", (int)strlen(text) - 2, text);
    if (!done)
        snprintf(reason, 256, "%.120s cannot be written: %.60s", text, strerror(errno));
    else if (!compile_kernel(compiler, flags, lanes, tag, text, made, reason))
        done = false;
    else if (access(made, R_OK) != 0) {
        snprintf(reason, 256, "%.160s wrote no object", compiler);
        done = false;
    } else {
        done = cache_seal(made, tag) && rename(made, object) == 0;
        if (!done)
            snprintf(reason, 256, "%.120s cannot be written: %.60s", object, strerror(errno));
        else if (rename(text, kept) != 0)
            unlink(kept); // it is there to be read only; none is better than another's
    }
    unlink(text);
    unlink(made);
    return done;
}

static bool open_object(const char *object, const char *tag, struct loaded *loaded) {
    if (!cache_sealed(object, tag))
        return false;
    loaded->library = dlopen(object, RTLD_NOW | RTLD_LOCAL);
    if (!loaded->library)
        return false;
    const struct scene_kernel *kernel = dlsym(loaded->library, "stepwise_kernel");
    if (kernel && strcmp(kernel->tag, tag) == 0) {
        loaded->kernel = kernel;
        return true;
    }
    dlclose(loaded->library);
    loaded->library = NULL;
    return false;
}

static void say_why_not(const char *object, struct loaded *loaded) {
    const char *why = dlerror(); // begins with the file's name
    snprintf(loaded->reason, sizeof loaded->reason, "cannot load %.200s", why ? why : object);
}

static void find_or_make(const char *source, int lanes, const char *flags, struct loaded *loaded) {
    char compiler[4096], folder[4096], object[4400];
    find_compiler(compiler, loaded->reason);
    if (!*compiler || !cache_folder(folder, loaded->reason))
        return;
    name_kernel(source, flags, lanes, compiler, loaded->hash);
    snprintf(object, sizeof object, "%s/%s.so", folder, loaded->hash);
    uint64_t begin = now_ns();
    if (!open_object(object, loaded->hash, loaded)) {
        if (cache_sealed(
                object,
                loaded
                    ->hash)) { // whole, and made anew it would be the same: a folder without execution
            say_why_not(object, loaded);
            return;
        }
        uint64_t compile = now_ns();
        bool made = make_object(source, folder, compiler, flags, lanes, loaded->hash, object,
                                loaded->reason);
        begin = now_ns();
        loaded->facts.compile_ns = begin - compile; // for nothing, if it failed: the record says it
        if (!made)
            return;
        if (!open_object(object, loaded->hash, loaded))
            say_why_not(object, loaded);
    }
    loaded->facts.load_ns = now_ns() - begin;
}

void kernel_load(const struct prepared *prepared, int lanes, const char *flags,
                 struct loaded *loaded) {
    *loaded = (struct loaded){0};
    uint64_t begin = now_ns();
    char *scene = generate_scene(prepared), *source = scene ? kernel_source(scene) : NULL;
    loaded->facts.generate_ns = now_ns() - begin;
    if (source)
        find_or_make(source, lanes, flags, loaded);
    else
        snprintf(loaded->reason, sizeof loaded->reason, "memory is short");
    free(source);
    free(scene);
    struct kernel_facts *facts = &loaded->facts;
    facts->generated = loaded->kernel != NULL;
    facts->reason = facts->generated ? NULL : loaded->reason;
    facts->hash = facts->generated ? loaded->hash : NULL;
    facts->compiler = facts->generated ? loaded->kernel->compiler : NULL;
    const char *asked = getenv("STEPWISE_CC"); // who asks for none needs no word
    if (!facts->generated && !(asked && strcmp(asked, "none") == 0))
        fprintf(stderr, "opt10_scene: no kernel for this scene (%s); opt9_convex's run instead\n",
                loaded->reason);
}

void kernel_unload(struct loaded *loaded) {
    if (loaded->library)
        dlclose(loaded->library);
    loaded->library = NULL;
    loaded->kernel = NULL;
}
