// A kernel for one scene: frame/analytic_tile.c and below, compiled with the scene as constants and cached by
// its hash. Camera, light, max_steps and hit_distance stay variables, because a sweep varies them.
#pragma once

#include "core/prepared.h"
#include "phase.h"

// What a compiled kernel exports as `stepwise_kernel`.
struct scene_kernel {
    const char *tag; // its hash: a check against loading another kernel
    const char *compiler;
    size_t scratch_size;
    int (*tiles)(const struct job *job);
    void (*tile)(const void *job, int tile, void *memory);
    // What a kernel computes once a frame for all its tiles, in job->frame_memory; NULL: nothing. False: the general
    // code draws the frame.
    size_t frame_size;
    bool (*begin)(const struct job *job);
};

#ifndef SCENE_KERNEL
struct loaded_kernel {
    const struct scene_kernel *kernel; // NULL: none, and facts.reason says why
    void *library;
    struct kernel_facts facts;
    char reason[256], hash[17];
};

// Finds the scene's kernel in the cache or makes it. Precondition: prepared->analytic. Without a kernel the
// general code runs, and loaded->reason says why.
void kernel_load(const struct prepared *prepared, int lanes, const char *flags,
                 struct loaded_kernel *loaded);
void kernel_unload(struct loaded_kernel *loaded);

// kernel/generate.c: returns the kernel's whole source, to be freed; NULL: memory is short.
char *kernel_source(const struct prepared *prepared);

// kernel/compile.c. Sets the compiler: the path of STEPWISE_CC's, else of what built this program, with the words
// behind it; or an empty string and the reason.
void find_compiler(char path[4096], char reason[256]);
// Says which files the compiler's words are, so that another version makes kernels anew.
void identify_compiler(const char *compiler, char text[8192]);
// Runs the compiler. Returns false and sets the reason if it fails.
bool compile_kernel(const char *compiler, const char *flags, int lanes, const char *tag,
                    const char *source_path, const char *object_path, char reason[256]);

// kernel/cache.c. Sets and makes the cache folder. Returns false and sets the reason if that fails.
bool cache_folder(char path[4096], char reason[256]);
// Removes files that killed compilers left an hour ago or earlier, kernels unused for 30 days, and the least
// recently used above MAX_CACHED files.
void cache_sweep(const char *folder);
// Marks a kernel or its source as used now.
void cache_used(const char *path);
// Appends a seal to a compiled file, and checks it, so that a truncated or damaged file is not loaded.
bool cache_seal(const char *path, const char *tag, const char *text);
bool cache_sealed(const char *path, const char *tag, const char *text);
// Returns whether the file holds exactly this text.
bool cache_holds(const char *path, const char *text);
unsigned long long fnv(unsigned long long hash, const void *bytes, size_t count);
#define FNV_BEGIN 0xcbf29ce484222325ull
#endif
