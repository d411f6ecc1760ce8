#include "bench.h"

bool runs_here(const struct entries *of) {
#ifdef __x86_64__
    __builtin_cpu_init();
    bool fma = __builtin_cpu_supports("fma");
    if (of->bits == 512)
        return fma && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq");
    if (of->bits == 256)
        return fma && __builtin_cpu_supports("avx2");
    return of->bits < 128 || __builtin_cpu_supports("sse4.1"); // libmvec's b variants use it
#else
    return of->bits <= 128;
#endif
}
