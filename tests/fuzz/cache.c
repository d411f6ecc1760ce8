// Fuzzes the cache of generated kernels (phases/opt10_scene/kernel/cache.c): files of any content and name in its
// folder. A file that the cache would load is one that the cache sealed, and sweeping touches no other's files.
#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "kernel/kernel.h"

#define CHECK(condition) ((condition) ? (void)0 : broken(#condition, __LINE__))
static const char TEXT[] = "a kernel's source", TAG[] = "0123456789abcdef";
static char folder[64], object[128], source[128];

static void broken(const char *condition, int line) {
    fprintf(stderr, "cache.c:%d: does not hold: %s\n", line, condition);
    abort();
}

static void write_file(const char *path, const uint8_t *data, size_t size) {
    FILE *file = fopen(path, "wb");
    CHECK(file && fwrite(data, 1, size, file) == size && fclose(file) == 0);
}

static void remove_folder(void) {
    DIR *all = opendir(folder);
    for (struct dirent *one; all && (one = readdir(all));)
        if (one->d_name[0] != '.' || one->d_name[1] == '-')
            unlinkat(dirfd(all), one->d_name, 0);
    if (all)
        closedir(all);
    rmdir(folder);
}

// Whatever bytes stand in a kernel's place: they count as its own only if they are what was sealed.
static void check_contents(const uint8_t *data, size_t size) {
    write_file(object, data, size);
    cache_sealed(object, TAG, TEXT);
    CHECK(cache_seal(object, TAG,
                     TEXT)); // behind them: now they are sealed, but for a file of nothing
    CHECK(cache_sealed(object, TAG, TEXT) == (size > 0));
    CHECK(!cache_sealed(object, TAG, "another source"));
    CHECK(!cache_sealed(object, "0123456789abcdee", TEXT));
    if (size) { // with one bit changed, the seal does not hold
        int file = open(object, O_RDWR);
        uint8_t byte = data[size / 2] ^ 1;
        CHECK(pwrite(file, &byte, 1, (off_t)(size / 2)) == 1 && close(file) == 0);
        CHECK(!cache_sealed(object, TAG, TEXT));
    }
    write_file(source, data, size);
    bool same = size == strlen(TEXT) && memcmp(data, TEXT, size) == 0;
    CHECK(cache_holds(source, TEXT) == same);
}

// A file of any name, a year old. Only the cache's own names go.
static void check_sweep(const uint8_t *data, size_t size) {
    char name[64], path[256];
    snprintf(name, sizeof name, "%.*s", (int)(size < 60 ? size : 60), (const char *)data);
    if (!*name || strchr(name, '/') || strcmp(name, ".") == 0 || strcmp(name, "..") == 0)
        return;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    write_file(path, data, size);
    struct timespec year_ago[2] = {{.tv_sec = time(NULL) - 365 * 24 * 3600}};
    year_ago[1] = year_ago[0];
    CHECK(utimensat(AT_FDCWD, path, year_ago, 0) == 0);
    cache_sweep(folder);
    size_t digits = strspn(name, "0123456789abcdef");
    bool kernel = digits == 16 && (strcmp(name + 16, ".so") == 0 || strcmp(name + 16, ".c") == 0);
    bool begun = name[0] == '.' && strspn(name + 1, "0123456789abcdef") > 0;
    bool gone = access(path, F_OK) != 0;
    CHECK(!kernel || gone);
    CHECK(kernel || begun || !gone);
    unlink(path);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (!*folder) {
        snprintf(folder, sizeof folder, "/dev/shm/stepwise-fuzz-%d", (int)getpid());
        snprintf(object, sizeof object, "%s/%s.so", folder, TAG);
        snprintf(source, sizeof source, "%s/%s.c", folder, TAG);
        CHECK(mkdir(folder, 0700) == 0);
        atexit(remove_folder);
    }
    check_contents(data, size);
    check_sweep(data, size);
    return 0;
}
