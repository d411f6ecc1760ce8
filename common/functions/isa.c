// Whether this CPU has the instruction sets that a file of functions is built for.
#include <string.h>

#include "bench.h"

bool has_isa(const char *needs) {
    static const char *const known[] = {"sse2", "sse4.1", "avx2", "fma", "avx512f", "avx512dq"};
    __builtin_cpu_init();
    const bool here[] = {__builtin_cpu_supports("sse2"),    __builtin_cpu_supports("sse4.1"),
                         __builtin_cpu_supports("avx2"),    __builtin_cpu_supports("fma"),
                         __builtin_cpu_supports("avx512f"), __builtin_cpu_supports("avx512dq")};
    for (const char *word = needs; *word; word += strspn(word, " ")) {
        size_t length = strcspn(word, " ");
        bool found = false;
        for (size_t i = 0; i < sizeof known / sizeof *known; i++)
            found |= strlen(known[i]) == length && !strncmp(word, known[i], length) && here[i];
        if (!found)
            return false;
        word += length;
    }
    return true;
}
