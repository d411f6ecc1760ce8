// Gamma and 8 bits by one table look-up and one addition per sample, exactly as the formula in double precision.
// The byte is the number of the 255 thresholds that a sample reaches. The upper half of a positive float's bits
// selects a bin, 1/128 of its start wide; the closest thresholds are 1.1 % apart, so a bin contains at most one. The
// table word makes the addition carry out of the lower half exactly from that threshold on.
#ifdef __x86_64__
#include <immintrin.h>
#endif
#include <math.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "frame/frame.h"
#include "workers/cpus.h"

// Bins FIRST to LAST cover the floats from below the first threshold to 1. bits + table word has the
// displayed byte in bits 16 to 23.
enum { HALF = 16, CARRY = 1 << HALF, FIRST = 0x3600, LAST = 0x3f80 };

// Each thread gets at least this many samples: 50 µs of work, about the time that starting it takes.
enum { SAMPLES_PER_THREAD = 1 << 16, CACHE_LINE_SAMPLES = 64, MAX_THREADS = 64 };

// `from_memory`: the samples are not in the cache.
typedef void convert(const struct presenter *p, const float *linear, size_t samples, uint8_t *shown,
                     bool from_memory);

struct presenter {
    convert *convert;
    int threads;
    struct cpus cpus; // of the process before a phase pins the calling thread
    uint32_t bins[LAST - FIRST + 1];
    float power[32]; // levels of 2^0 to 2^-31, by the lowest five bits of the exponent
};

static int displayed_level(float c) {
    return (int)(fmin(1.0, pow((double)c, 0.4545)) * 255.0);
}

static float from_bits(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

// Bits of the smallest float that is displayed as k or more, by bisection.
static uint32_t threshold(int k) {
    uint32_t lo = 0, hi = (uint32_t)LAST << HALF; // displayed_level(lo) < k <= displayed_level(hi)
    while (hi - lo > 1) {
        uint32_t middle = lo + (hi - lo) / 2;
        if (displayed_level(from_bits(middle)) >= k)
            hi = middle;
        else
            lo = middle;
    }
    return hi;
}

// One sample at a time, on every CPU.
static void convert_scalar(const struct presenter *p, const float *linear, size_t samples,
                           uint8_t *shown, bool from_memory) {
    (void)from_memory;
    for (size_t i = 0; i < samples; i++) {
        float c = linear[i], least = from_bits((uint32_t)FIRST << HALF);
        c = c > least ? c : least; // NaN too
        c = c < 1.0f ? c : 1.0f;
        uint32_t bits;
        memcpy(&bits, &c, sizeof bits);
        shown[i] = (uint8_t)((bits + p->bins[(bits >> HALF) - FIRST]) >> HALF);
    }
}

#ifdef __x86_64__
// Samples to prefetch ahead. A picture is larger than L2, and the look-up's own loads fill the
// out-of-order window.
enum { PREFETCH_DISTANCE = 1024 };

static inline void prefetch(const float *from) {
    // Prefetching an address beyond the picture does no harm.
    uintptr_t address = (uintptr_t)from + PREFETCH_DISTANCE * sizeof *from;
    _mm_prefetch((const char *)address, _MM_HINT_T0);
}

// Table words of two lanes. Separate loads take 8.2 TSC cycles for 8 lanes, a gather instruction
// 10.6 (Zen 3, samples in L1).
__attribute__((target("avx2"))) static inline __m128i gather_2(const uint32_t *bins,
                                                               uint64_t indices) {
    __m128i one = _mm_cvtsi32_si128((int)bins[(size_t)(uint32_t)indices - FIRST]);
    return _mm_insert_epi32(one, (int)bins[(size_t)(indices >> 32) - FIRST], 1);
}

__attribute__((target("avx2"))) static inline __m128i gather_4(const uint32_t *bins,
                                                               __m128i indices) {
    return _mm_unpacklo_epi64(gather_2(bins, (uint64_t)_mm_cvtsi128_si64(indices)),
                              gather_2(bins, (uint64_t)_mm_extract_epi64(indices, 1)));
}

__attribute__((target("avx2"))) static void convert_8(const struct presenter *p,
                                                      const float *linear, size_t samples,
                                                      uint8_t *shown, bool from_memory) {
    const __m256 least = _mm256_castsi256_ps(_mm256_set1_epi32(FIRST << HALF));
    // The third byte of each 32-bit lane, of 128 bits at a time.
    const __m256i bytes = _mm256_broadcastsi128_si256(
        _mm_setr_epi8(2, 6, 10, 14, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1));
    size_t i = 0;
    for (; i + 8 <= samples; i += 8) {
        if (from_memory)
            prefetch(linear + i);
        // maxps returns its second operand where the first is NaN.
        __m256 c = _mm256_max_ps(_mm256_loadu_ps(linear + i), least);
        __m256i bits = _mm256_castps_si256(_mm256_min_ps(c, _mm256_set1_ps(1.0f)));
        __m256i index = _mm256_srli_epi32(bits, HALF);
        __m128i low = gather_4(p->bins, _mm256_castsi256_si128(index)),
                high = gather_4(p->bins, _mm256_extracti128_si256(index, 1));
        __m256i bin = _mm256_inserti128_si256(_mm256_castsi128_si256(low), high, 1);
        __m256i byte = _mm256_shuffle_epi8(_mm256_add_epi32(bits, bin), bytes);
        __m128i both =
            _mm_unpacklo_epi32(_mm256_castsi256_si128(byte), _mm256_extracti128_si256(byte, 1));
        _mm_storel_epi64((__m128i *)(shown + i), both);
    }
    _mm256_zeroupper(); // see convert_16
    convert_scalar(p, linear + i, samples - i, shown + i, from_memory);
}

// How far off a level is at most, in its units: the polynomial by a relative 1.15e-6, float's rounding by another 2e-7.
enum { DOUBT = 32 };

// Returns 255·c^0.4545 in units of 2^-16, 2^-19 <= c < 1.003: the exponent's power times a polynomial of the mantissa.
__attribute__((target("avx512f"))) static inline __m512i levels_16(const float power[32],
                                                                   __m512 c) {
    static const float of[] = {-0.0507527851f, 0.206647694f, -0.491627812f, 0.993953466f,
                               0.336425841f};
    __m512i bits = _mm512_castps_si512(c), one = _mm512_set1_epi32(0x3f800000);
    __m512 mantissa = _mm512_castsi512_ps( // bits & fraction | one
        _mm512_ternarylogic_epi32(bits, _mm512_set1_epi32(0x7fffff), one, 0xea));
    __m512 sum = _mm512_set1_ps(0.00535471039f);
    for (int i = 0; i < 5; i++)
        sum = _mm512_fmadd_ps(sum, mantissa, _mm512_set1_ps(of[i]));
    __m512 whole = _mm512_permutex2var_ps(_mm512_loadu_ps(power), _mm512_srli_epi32(bits, 23),
                                          _mm512_loadu_ps(power + 16));
    return _mm512_cvtps_epi32(_mm512_mul_ps(sum, whole));
}

// A gather from the bins would be 16 loads. Samples beside those that are DOUBT from a threshold go there, one by one.
__attribute__((target("avx512f"))) static void convert_16(const struct presenter *p,
                                                          const float *linear, size_t samples,
                                                          uint8_t *shown, bool from_memory) {
    const __m512 least = _mm512_castsi512_ps(_mm512_set1_epi32(FIRST << HALF));
    size_t i = 0;
    for (; i + 16 <= samples; i += 16) {
        if (from_memory)
            prefetch(linear + i);
        __m512 c = _mm512_max_ps(_mm512_loadu_ps(linear + i), least);
        c = _mm512_min_ps(c, _mm512_set1_ps(1.001f)); // 1 itself would be in doubt
        __m512i level = levels_16(p->power, c);
        __m512i doubt = _mm512_set1_epi32(DOUBT), clear = _mm512_set1_epi32(CARRY - 2 * DOUBT);
        if (_mm512_testn_epi32_mask(_mm512_add_epi32(level, doubt), clear))
            convert_scalar(p, linear + i, 16, shown + i, from_memory);
        else
            _mm_storeu_si128((__m128i *)(shown + i),
                             _mm512_cvtepi32_epi8(_mm512_srli_epi32(level, HALF)));
    }
    // Required: gcc 12 omits vzeroupper before a tail call in a file that is not compiled for AVX. With dirty
    // upper halves scalar frames took 3 to 10 times as long on Emerald Rapids
    // (tests/c/frame/test_upper_halves.c).
    _mm256_zeroupper();
    convert_scalar(p, linear + i, samples - i, shown + i, from_memory);
}

#endif

// STEPWISE_ISA_LIMIT hides instruction sets, as for the phases (driver/variant.h).
static void choose_widest(struct presenter *p) {
    p->convert = convert_scalar; // on aarch64 too, whose vectors have no table words to load
#ifdef __x86_64__
    const char *limit = getenv("STEPWISE_ISA_LIMIT");
    bool none = limit && strcmp(limit, "none") == 0, narrow = limit && strcmp(limit, "avx2") == 0;
    __builtin_cpu_init();
    if (!none && !narrow && __builtin_cpu_supports("avx512f"))
        p->convert = convert_16;
    else if (!none && __builtin_cpu_supports("avx2"))
        p->convert = convert_8;
#endif
}

struct presenter *presenter_create(int threads) {
    struct presenter *p = malloc(sizeof *p);
    if (!p)
        return NULL;
    choose_widest(p);
    p->cpus = (struct cpus){0};
    p->threads = cpus_get(&p->cpus) == 0 ? threads : 1;
    for (uint32_t bin = FIRST; bin <= LAST; bin++)
        p->bins[bin - FIRST] = ((uint32_t)displayed_level(from_bits(bin << HALF)) - bin) << HALF;
    for (int k = 1; k < 256; k++) {
        uint32_t bits = threshold(k), low = bits & (CARRY - 1);
        if (low > 0) // else the bin starts with the threshold
            p->bins[(bits >> HALF) - FIRST] += CARRY - low;
    }
    for (int i = 0; i < 32; i++)
        p->power[(127 - i) & 31] = (float)(255 * CARRY * pow(2, -0.4545 * i));
    return p;
}

void presenter_free(struct presenter *presenter) {
    if (presenter)
        cpus_free(&presenter->cpus);
    free(presenter);
}

// The samples that one thread converts.
struct part {
    const struct presenter *presenter;
    const float *linear;
    size_t samples;
    uint8_t *shown;
};

static void *present_part(void *data) {
    const struct part *p = data;
    p->presenter->convert(p->presenter, p->linear, p->samples, p->shown, true);
    return NULL;
}

// Starts a thread for `part` on any CPU of the process; false if there is none to be had.
static bool start_part(pthread_t *thread, struct part *part) {
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes) != 0)
        return false;
    const struct cpus *cpus = &part->presenter->cpus;
    bool started = pthread_attr_setaffinity_np(&attributes, cpus->size, cpus->set) == 0 &&
                   pthread_create(thread, &attributes, present_part, part) == 0;
    pthread_attr_destroy(&attributes);
    return started;
}

void presenter_show(const struct presenter *presenter, const float *linear, size_t samples,
                    uint8_t *shown) {
    presenter->convert(presenter, linear, samples, shown, false);
}

void frame_present(const struct presenter *presenter, const struct frame *frame, uint8_t *rgb8) {
    const size_t samples = 3 * (size_t)frame->width * (size_t)frame->height;
    size_t count =
        samples / SAMPLES_PER_THREAD < MAX_THREADS ? samples / SAMPLES_PER_THREAD : MAX_THREADS;
    if (count > (size_t)presenter->threads)
        count = (size_t)presenter->threads;
    size_t each = count > 1 ? samples / count / CACHE_LINE_SAMPLES * CACHE_LINE_SAMPLES : 0;
    struct part parts[MAX_THREADS];
    pthread_t threads[MAX_THREADS];
    size_t started = 0; // the calling thread converts the rest, which is all if no thread starts
    for (; started + 1 < count; started++) {
        size_t at = started * each;
        parts[started] = (struct part){presenter, frame->rgb + at, each, rgb8 + at};
        if (!start_part(&threads[started], &parts[started]))
            break;
    }
    size_t at = started * each;
    presenter->convert(presenter, frame->rgb + at, samples - at, rgb8 + at, true);
    for (size_t i = 0; i < started; i++)
        pthread_join(threads[i], NULL);
}
