// What this CPU's approximate reciprocal square roots give: special values, the largest error, and a
// hash over every mantissa and both parities of the exponent. One JSON object on standard output.
//
// rsqrtss and rsqrtps are promised to 1.5·2^-12 and no more (Intel 64 and IA-32 Architectures Software
// Developer's Manual, volume 2, RSQRTSS): each maker has a table of its own. vrsqrt14ps (AVX-512F,
// 2^-14) is specified to the bit by Intel's reference code. Their results scale by 2 for every 4 in
// the argument, so [1, 4) is the whole table.
#include <immintrin.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cpuid.h>

struct special {
    const char *name;
    uint32_t bits;
};

static const struct special SPECIALS[] = {
    {"0", 0},
    {"-0", 0x80000000},
    {"smallest denormal", 1},
    {"largest denormal", 0x007fffff},
    {"smallest normal", 0x00800000},
    {"inf", 0x7f800000},
    {"-1", 0xbf800000},
    {"nan", 0x7fc00000},
};

enum { LANES = 16, SPECIAL_COUNT = sizeof SPECIALS / sizeof *SPECIALS };
enum { FIRST = 0x3f800000, LAST = 0x407fffff }; // 1 to just below 4

static float from_bits(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint32_t to_bits(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

typedef void (*sixteen)(const float *in, float *out);

static void by_rsqrtss(const float *in, float *out) {
    for (int i = 0; i < LANES; i++)
        out[i] = _mm_cvtss_f32(_mm_rsqrt_ss(_mm_set_ss(in[i])));
}

static void by_rsqrtps(const float *in, float *out) {
    for (int i = 0; i < LANES; i += 4)
        _mm_storeu_ps(out + i, _mm_rsqrt_ps(_mm_loadu_ps(in + i)));
}

__attribute__((target("avx512f"))) static void by_rsqrt14(const float *in, float *out) {
    _mm512_storeu_ps(out, _mm512_rsqrt14_ps(_mm512_loadu_ps(in)));
}

static void print_value(float value) {
    if (isnan(value))
        printf("\"nan\"");
    else if (isinf(value))
        printf(value > 0 ? "\"inf\"" : "\"-inf\"");
    else
        printf("%.9g", (double)value);
}

// FNV-1a (Fowler, Noll, Vo), fed with whole results.
static void describe(const char *name, sixteen function) {
    uint64_t hash = 0xcbf29ce484222325u;
    double worst = 0;
    float in[LANES], out[LANES];
    for (uint32_t bits = FIRST; bits <= LAST; bits += LANES) {
        for (uint32_t i = 0; i < LANES; i++)
            in[i] = from_bits(bits + i);
        function(in, out);
        for (int i = 0; i < LANES; i++) {
            hash = (hash ^ to_bits(out[i])) * 0x100000001b3u;
            double error = fabs((double)out[i] * sqrt((double)in[i]) - 1.0);
            if (!(error <= worst))
                worst = error;
        }
    }
    printf("\"%s\": {\"hash\": \"%016llx\", \"worst_relative_error\": %.6g", name,
           (unsigned long long)hash, worst);
    for (int s = 0; s < SPECIAL_COUNT; s++) {
        for (int i = 0; i < LANES; i++)
            in[i] = from_bits(SPECIALS[s].bits);
        function(in, out);
        printf(", \"%s\": ", SPECIALS[s].name);
        print_value(out[0]);
    }
    printf("}");
}

int main(void) {
    unsigned a, vendor[4] = {0};
    __get_cpuid(0, &a, &vendor[0], &vendor[2], &vendor[1]); // EBX, EDX, ECX spell it
    printf("{\"vendor\": \"%.12s\", ", (const char *)vendor);
    describe("rsqrtss", by_rsqrtss);
    printf(", ");
    describe("rsqrtps", by_rsqrtps);
    printf(", ");
    if (__builtin_cpu_supports("avx512f"))
        describe("rsqrt14", by_rsqrt14);
    else
        printf("\"rsqrt14\": null");
    printf("}\n");
    return fflush(stdout) == 0 ? 0 : 2;
}
