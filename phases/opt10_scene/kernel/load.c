// Loads a scene's kernel: found in the cache or made, and checked.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "kernel/kernel.h"
#include "timing/timer.h"

// Returns a kernel's whole text: its source behind a line with the flags and the identity of the compiler's
// file. To be freed; NULL: memory is short.
static char *text_of(const char *source, const char *flags, int lanes, const char *compiler) {
    char identity[8192], *text;
    identify_compiler(compiler, identity);
    if (asprintf(&text, "// %d lanes; %s; %s.\n", lanes, flags, identity) < 0)
        return NULL;
    size_t head = strlen(text), length = strlen(source);
    char *whole = realloc(text, head + length + 1);
    if (whole)
        memcpy(whole + head, source, length + 1);
    else
        free(text);
    return whole;
}

// Makes the object under a temporary name and renames it, so that readers find a whole file or none.
static bool make_object(const char *source, const char *folder, const char *compiler,
                        const char *flags, int lanes, const char *tag, const char *object,
                        const char *kept, char reason[256]) {
    char text[4400], made[4400];
    snprintf(text, sizeof text, "%s/.%s-XXXXXX.c", folder, tag);
    cache_sweep(folder);
    int opened =
        mkostemps(text, 2, O_CLOEXEC); // not named by process id: containers may share the folder
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
        done = cache_seal(made, tag, source) && rename(made, object) == 0;
        if (!done)
            snprintf(reason, 256, "%.120s cannot be written: %.60s", object, strerror(errno));
        else if (rename(text, kept) != 0)
            unlink(kept); // the kernel is used now, and made again next time
    }
    unlink(text);
    unlink(made);
    return done;
}

static bool open_object(const char *object, const char *tag, const char *text,
                        struct loaded_kernel *loaded) {
    if (!cache_sealed(object, tag, text))
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

static void say_why_not(const char *object, struct loaded_kernel *loaded) {
    const char *why = dlerror(); // begins with the file's name
    snprintf(loaded->reason, sizeof loaded->reason, "cannot load %.200s", why ? why : object);
}

// Finds the kernel, or makes it. Its name is a hash that two sources may share, so the source beside it must
// be equal.
static void find_or_make(const char *text, int lanes, const char *flags, const char *compiler,
                         struct loaded_kernel *loaded) {
    char folder[4096], object[4400], kept[4400];
    if (!cache_folder(folder, loaded->reason))
        return;
    const char *tag = loaded->hash;
    snprintf(loaded->hash, sizeof loaded->hash, "%016llx", fnv(FNV_BEGIN, text, strlen(text)));
    snprintf(object, sizeof object, "%s/%s.so", folder, tag);
    snprintf(kept, sizeof kept, "%s/%s.c", folder, tag);
    uint64_t begin = timer_ns();
    cache_used(kept); // before it is opened, so that a concurrent sweep keeps it
    cache_used(object);
    bool same = cache_holds(kept, text);
    if (!same || !open_object(object, tag, text, loaded)) {
        if (same && cache_sealed(object, tag, text)) { // making it again would not help:
            say_why_not(object, loaded);               // the folder may forbid execution
            return;
        }
        uint64_t compile = timer_ns();
        bool made =
            make_object(text, folder, compiler, flags, lanes, tag, object, kept, loaded->reason);
        begin = timer_ns();
        loaded->facts.compile_ns = begin - compile; // recorded even if it failed
        if (!made)
            return;
        if (!open_object(object, tag, text, loaded))
            say_why_not(object, loaded);
    }
    loaded->facts.load_ns = timer_ns() - begin;
}

void kernel_load(const struct prepared *prepared, int lanes, const char *flags,
                 struct loaded_kernel *loaded) {
    *loaded = (struct loaded_kernel){0};
    uint64_t begin = timer_ns();
    char compiler[4096];
    find_compiler(compiler, loaded->reason);
    char *source = *compiler ? kernel_source(prepared) : NULL;
    char *text = source ? text_of(source, flags, lanes, compiler) : NULL;
    loaded->facts.generate_ns = timer_ns() - begin;
    if (text)
        find_or_make(text, lanes, flags, compiler, loaded);
    else if (!*loaded->reason)
        snprintf(loaded->reason, sizeof loaded->reason, "memory is short");
    free(text);
    free(source);
    struct kernel_facts *facts = &loaded->facts;
    facts->generated = loaded->kernel != NULL;
    facts->reason = facts->generated ? NULL : loaded->reason;
    facts->hash = facts->generated ? loaded->hash : NULL;
    facts->compiler = facts->generated ? loaded->kernel->compiler : NULL;
    const char *chosen = getenv("STEPWISE_CC"); // no message if the user wants no kernel
    if (!facts->generated && !(chosen && strcmp(chosen, "none") == 0))
        fprintf(stderr,
                "opt10_scene: no kernel for this scene (%s); its general code runs instead\n",
                loaded->reason);
}

void kernel_unload(struct loaded_kernel *loaded) {
    if (loaded->library)
        dlclose(loaded->library);
    loaded->library = NULL;
    loaded->kernel = NULL;
}
