// A kernel made for one scene: core/analytic_tile.c and what it calls, compiled anew with the scene's shapes, counts,
// features and constants known (scene_kernel.h, which kernel/generate.c writes), kept in a cache by its hash.
// What is not in it: the limits of the march that a sweep varies (max_steps, hit_distance), camera and light.
#ifndef OPT10_KERNEL_H
#define OPT10_KERNEL_H

#include "core/primitive.h"
#include "phase.h"

// What a compiled kernel shows, as `stepwise_kernel`.
struct scene_kernel {
    const char *tag; // its own hash: no other kernel passes for it
    const char *compiler;
    size_t scratch_size;
    int (*tiles)(const struct job *job);
    void (*tile)(const struct job *job, int tile, void *memory);
};

#ifndef SCENE_KERNEL
struct loaded_kernel {
    const struct scene_kernel *kernel; // NULL: none, and facts.reason says why
    void *library;
    struct kernel_facts facts;
    char reason[256], hash[17];
};

// Makes or finds the kernel for a scene that core/analytic_tile.c can have. Never fails: without one, the general kernels run.
void kernel_load(const struct prepared *prepared, int lanes, const char *flags,
                 struct loaded_kernel *loaded);
void kernel_unload(struct loaded_kernel *loaded);

// kernel/generate.c: the text of scene_kernel.h, to be freed; NULL: memory is short.
char *generate_scene(const struct prepared *prepared);
// kernel/sources.c: the kernel's whole source with that in it, to be freed; NULL: memory is short.
char *kernel_source(const char *scene_text);

// kernel/compile.c. The compiler's path, or an empty string and why there is none.
void find_compiler(char path[4096], char reason[256]);
// Runs it without a shell; false and why not.
bool compile_kernel(const char *compiler, const char *flags, int lanes, const char *tag,
                    const char *source_path, const char *object_path, char reason[256]);

// kernel/cache.c. The folder, made if it is not there; false and why not.
bool cache_folder(char path[4096], char reason[256]);
// Removes what processes that were killed while they compiled have left there an hour ago or longer, kernels that nobody
// has asked for in 30 days, and of more than 500 those that were asked for longest ago.
void cache_sweep(const char *folder);
// Says of a kernel or its source that it was asked for now.
void cache_used(const char *path);
// Behind what was compiled: a checksum, so that a file cut short or written over is not loaded.
bool cache_seal(const char *path, const char *tag, const char *text);
bool cache_sealed(const char *path, const char *tag, const char *text);
// Whether a file is there and has that text, no more and no less.
bool cache_holds(const char *path, const char *text);
unsigned long long fnv(unsigned long long hash, const void *bytes, size_t count);
#define FNV_BEGIN 0xcbf29ce484222325ull
#endif

#endif
