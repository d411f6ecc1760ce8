// See working_sets.h.
#include "working_sets.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

const char *const LEVEL_NAMES[LEVELS] = {"L1", "L2", "L3", "memory"};

bool cpu_supports(const char *feature) {
    const char *limit = getenv("STEPWISE_ISA_LIMIT"); // see driver/variant.h
    if (!feature)
        return true;
    if (limit && strcmp(limit, "none") == 0)
        return false;
    if (limit && strcmp(limit, "avx2") == 0 && strncmp(feature, "avx512", 6) == 0)
        return false;
#ifdef __x86_64__
    __builtin_cpu_init();
    return (strcmp(feature, "avx") == 0 && __builtin_cpu_supports("avx")) ||
           (strcmp(feature, "fma") == 0 && __builtin_cpu_supports("fma")) ||
           (strcmp(feature, "avx512f") == 0 && __builtin_cpu_supports("avx512f")) ||
           (strcmp(feature, "avx512vl") == 0 && __builtin_cpu_supports("avx512vl"));
#else
    return false;
#endif
}

// Reads one property of a cache of CPU 0 from sysfs; "" if there is none.
static void cache_word(int index, const char *name, char word[32]) {
    char path[96];
    word[0] = '\0';
    snprintf(path, sizeof path, "/sys/devices/system/cpu/cpu0/cache/index%d/%s", index, name);
    FILE *file = fopen(path, "r");
    if (!file)
        return;
    if (fscanf(file, "%31s", word) != 1)
        word[0] = '\0';
    fclose(file);
}

// Returns the size in bytes of the data or unified cache of a level, from sysfs or else from the C
// library. 0: unknown.
static size_t cache_bytes(int level) {
    for (int index = 0; index < 8; index++) {
        char found[32], type[32], size[32];
        cache_word(index, "level", found);
        cache_word(index, "type", type);
        cache_word(index, "size", size);
        long kib = atol(size); // sysfs writes "48K"
        if (atoi(found) == level && kib > 0 && strcmp(type, "Instruction") != 0)
            return (size_t)kib << 10;
    }
    long bytes = sysconf(level == 1   ? _SC_LEVEL1_DCACHE_SIZE
                         : level == 2 ? _SC_LEVEL2_CACHE_SIZE
                                      : _SC_LEVEL3_CACHE_SIZE);
    return bytes > 0 ? (size_t)bytes : 0;
}

// Returns the largest power of two up to `bytes`, at least 4096.
static size_t power_of_two(double bytes) {
    size_t power = 4096;
    while (2.0 * (double)power <= bytes)
        power *= 2;
    return power;
}

void choose_working_sets(struct working_set working_sets[LEVELS]) {
    size_t l1 = cache_bytes(1), l2 = cache_bytes(2), l3 = cache_bytes(3);
    double ram = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    double most = fmin(512.0 * 1048576, ram / 4), four = 4.0 * (double)(l3 ? l3 : l2);
    working_sets[L1] =
        (struct working_set){l1, l1 ? power_of_two((double)l1 / 2) : 0, NULL, "half of L1"};
    working_sets[L2] =
        (struct working_set){l2, l2 ? power_of_two((double)l2 / 2) : 0, NULL, "half of L2"};
    working_sets[L3] = (struct working_set){
        l3, l2 && l3 > 2 * l2 ? power_of_two(sqrt((double)l2 * (double)l3)) : 0, NULL,
        "geometric mean of L2 and L3"};
    working_sets[MEMORY] =
        (struct working_set){0, 0, NULL, "four times L3, at most 512 MiB and a quarter of memory"};
    working_sets[MEMORY].bytes = l2 || l3 ? power_of_two(fmin(four, most)) : power_of_two(most);
    for (int i = 0; i < LEVELS; i++)
        if (!working_sets[i].bytes)
            working_sets[i].missing =
                "the system does not say how large this cache is, or it has none";
    if (l3 && working_sets[MEMORY].bytes <= l3) {
        working_sets[MEMORY].bytes = 0;
        working_sets[MEMORY].missing = "a quarter of memory would still fit into L3";
    }
}
