// The cache of kernels: its folder, its size, and a seal on each file.
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "kernel/kernel.h"

// Returns the 64-bit FNV-1a hash (G. Fowler, L. C. Noll, K.-P. Vo). It detects damage, not an attacker who
// can write to the folder.
unsigned long long fnv(unsigned long long hash, const void *bytes, size_t count) {
    const unsigned char *b = bytes;
    for (size_t i = 0; i < count; i++)
        hash = (hash ^ b[i]) * 0x100000001b3ull;
    return hash;
}

static bool make_folders(char *path) {
    size_t length = strlen(path);
    for (size_t i = 1; i < length; i++) {
        if (path[i] != '/')
            continue;
        path[i] = '\0';
        bool made = mkdir(path, 0700) == 0 || errno == EEXIST;
        path[i] = '/';
        if (!made)
            return false;
    }
    return mkdir(path, 0700) == 0 || errno == EEXIST;
}

bool cache_folder(char path[4096], char reason[256]) {
    const char *own = getenv("STEPWISE_CACHE"), *xdg = getenv("XDG_CACHE_HOME"),
               *home = getenv("HOME");
    int length = own && *own     ? snprintf(path, 4000, "%s", own)
                 : xdg && *xdg   ? snprintf(path, 4000, "%s/stepwise", xdg)
                 : home && *home ? snprintf(path, 4000, "%s/.cache/stepwise", home)
                                 : 0;
    struct stat found;
    if (length <= 0 || length >= 4000)
        snprintf(reason, 256, "no folder to keep kernels in: set STEPWISE_CACHE");
    else if (!make_folders(path) || stat(path, &found) != 0)
        snprintf(reason, 256, "%.120s cannot be made: %s", path, strerror(errno));
    else if (!S_ISDIR(found.st_mode))
        snprintf(reason, 256, "%.120s is no folder", path);
    else if (found.st_uid != geteuid() || (found.st_mode & (S_IWGRP | S_IWOTH)))
        snprintf(reason, 256, "%.120s is %s: a folder of one's own is required", path,
                 found.st_uid != geteuid() ? "another user's" : "open to others");
    else
        return true;
    return false;
}

// A kernel is two files of 0.3 MB. Files used within IN_USE seconds stay, because a process that looked them
// up may still load them.
enum { MAX_CACHED = 1000, UNUSED = 30 * 24 * 3600, IN_USE = 3600 };

struct entry {
    char name[24];
    time_t used;
};

static int by_use(const void *a, const void *b) {
    time_t x = ((const struct entry *)a)->used, y = ((const struct entry *)b)->used;
    return (x < y) - (x > y); // most recent first
}

// Returns whether a file's name is that of a kernel or its source.
static bool is_kernel(const char *name) {
    size_t digits = strspn(name, "0123456789abcdef");
    return digits == 16 && (strcmp(name + 16, ".so") == 0 || strcmp(name + 16, ".c") == 0);
}

static void drop_unused(int folder, struct entry *kernels, size_t count, time_t now) {
    if (count)
        qsort(kernels, count, sizeof *kernels, by_use);
    for (size_t i = 0; i < count; i++) {
        time_t unused = now - kernels[i].used;
        struct stat found;
        if ((unused > UNUSED || (i >= MAX_CACHED && unused > IN_USE)) &&
            fstatat(folder, kernels[i].name, &found, AT_SYMLINK_NOFOLLOW) == 0 &&
            found.st_mtim.tv_sec == kernels[i].used) // not used since the listing
            unlinkat(folder, kernels[i].name, 0);
    }
}

void cache_sweep(const char *folder) {
    DIR *all = opendir(folder);
    time_t now = time(NULL);
    struct stat found;
    struct entry *kernels = NULL;
    size_t count = 0, room = 0;
    for (struct dirent *one; all && (one = readdir(all));) {
        char tag[17], own[2];
        bool kernel = is_kernel(one->d_name);
        if (!kernel && sscanf(one->d_name, ".%16[0-9a-f]-%1s", tag, own) != 2)
            continue;
        if (fstatat(dirfd(all), one->d_name, &found, AT_SYMLINK_NOFOLLOW) != 0)
            continue;
        if (!kernel) {
            if (now - found.st_mtim.tv_sec > IN_USE)
                unlinkat(dirfd(all), one->d_name, 0);
            continue;
        }
        if (count == room) {
            struct entry *more = realloc(kernels, (room = 2 * room + 256) * sizeof *kernels);
            if (!more)
                break;
            kernels = more;
        }
        strcpy(kernels[count].name, one->d_name); // 19 characters at most
        kernels[count++].used = found.st_mtim.tv_sec;
    }
    if (all) {
        drop_unused(dirfd(all), kernels, count, now);
        closedir(all);
    }
    free(kernels);
}

void cache_used(const char *path) {
    utimensat(AT_FDCWD, path, NULL, 0); // fails harmlessly in a read-only folder
}

bool cache_holds(const char *path, const char *text) {
    FILE *file = fopen(path, "rb");
    if (!file)
        return false;
    char part[16384];
    size_t left = strlen(text), got;
    bool same = true;
    while (same && (got = fread(part, 1, sizeof part, file)) > 0) {
        same = got <= left && memcmp(part, text, got) == 0;
        if (same) {
            text += got;
            left -= got;
        }
    }
    same = same && left == 0 && !ferror(file);
    fclose(file);
    return same;
}

// The seal behind a kernel's file. sum: hash of the file. text, length: of its source, by another hash than
// its name.
struct seal_record {
    char mark[8], tag[16];
    unsigned long long sum, text, length;
};

// Returns the hash of a file's first `count` bytes (SIZE_MAX: all). *read: their number.
static unsigned long long checksum_of(FILE *file, size_t count, size_t *read) {
    unsigned long long hash = FNV_BEGIN;
    char part[16384];
    *read = 0;
    for (size_t got; *read < count; *read += got) {
        size_t most = count - *read < sizeof part ? count - *read : sizeof part;
        if ((got = fread(part, 1, most, file)) == 0)
            break;
        hash = fnv(hash, part, got);
    }
    return hash;
}

static struct seal_record seal_of(const char *tag, const char *text, unsigned long long sum) {
    size_t length = strlen(text);
    struct seal_record seal = {.sum = sum, .text = fnv(~FNV_BEGIN, text, length), .length = length};
    memcpy(seal.mark, "stepwise", 8);
    memcpy(seal.tag, tag, 16);
    return seal;
}

bool cache_seal(const char *path, const char *tag, const char *text) {
    FILE *file = fopen(path, "r+b");
    if (!file)
        return false;
    size_t size;
    struct seal_record seal = seal_of(tag, text, checksum_of(file, SIZE_MAX, &size));
    bool done =
        !ferror(file) && fseek(file, 0, SEEK_END) == 0 && fwrite(&seal, sizeof seal, 1, file) == 1;
    return fclose(file) == 0 && done;
}

bool cache_sealed(const char *path, const char *tag, const char *text) {
    FILE *file = fopen(path, "rb");
    struct stat found;
    if (!file)
        return false;
    bool good = false;
    if (fstat(fileno(file), &found) == 0 && found.st_uid == geteuid() &&
        found.st_size > (off_t)sizeof(struct seal_record)) {
        size_t count = (size_t)found.st_size - sizeof(struct seal_record), read;
        struct seal_record expected = seal_of(tag, text, checksum_of(file, count, &read)), seal;
        good = read == count && fread(&seal, sizeof seal, 1, file) == 1 &&
               memcmp(&seal, &expected, sizeof seal) == 0;
    }
    fclose(file);
    return good;
}
