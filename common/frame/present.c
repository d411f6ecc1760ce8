// Gamma and 8 bits: a float is shown by finding its place among 255 thresholds, to the bit as the formula in
// double has it. The bits of a positive float grow with its value: their upper half names a bin that has at
// most one threshold in it (a bin of a binade is 1/128 of its start wide, two thresholds at 0.5 to 1 are 1.1 %
// apart at the least), from which on the lower half carries. One look-up and one addition a sample, 16, 8 or one at
// a time. Two polynomials (log2 and 2^x, a table look-up where they end within 2^-10 of a whole number) took 1.05
// times as long as by_8's gather, on Zen 3.
#include <immintrin.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "frame/frame.h"

// Bins of the floats from FIRST << HALF, below the first threshold, to 1. A bin's word is what its floats' bits lack, of 32
// bits, to the byte left of the lower half: the byte of the bin's start, and as much that the lower half carries
// from the bin's threshold on.
enum { HALF = 16, CARRY = 1 << HALF, FIRST = 0x3600, LAST = 0x3f80 };

// A look-up's loads leave the CPU no room to see far ahead, and a picture is larger than its nearer caches:
// samples are fetched this many before they are shown.
enum { AHEAD = 1024 };

static inline void fetch_ahead(const float *from) {
    uintptr_t place =
        (uintptr_t)from + AHEAD * sizeof *from; // past the picture's end it does no harm
    _mm_prefetch((const char *)place, _MM_HINT_T0);
}

// A thread more is started for this many samples: 50 µs of one thread's work, which its start takes too.
enum { APIECE = 1 << 16, WHOLE_LINES = 64, MOST = 64 };

typedef void convert(const uint32_t *bins, const float *linear, size_t samples, uint8_t *shown);

struct presenter {
    convert *far, *near; // of samples in memory, and of some that were just written
    int threads;
    cpu_set_t
        cpus; // the process's before a phase pins its caller: a thread started later would stay beside that one
    uint32_t bins[LAST - FIRST + 1];
};

static int level(float c) {
    return (int)(fmin(1.0, pow((double)c, 0.4545)) * 255.0);
}

static float from_bits(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

// The smallest float that shows as k or more, as its bits.
static uint32_t threshold(int k) {
    uint32_t lo = 0, hi = (uint32_t)LAST << HALF; // level(lo) < k <= level(hi)
    while (hi - lo > 1) {
        uint32_t middle = lo + (hi - lo) / 2;
        if (level(from_bits(middle)) >= k)
            hi = middle;
        else
            lo = middle;
    }
    return hi;
}

static void one_by_one(const uint32_t *bins, const float *linear, size_t samples, uint8_t *shown) {
    for (size_t i = 0; i < samples; i++) {
        float c = linear[i], least = from_bits((uint32_t)FIRST << HALF);
        c = c > least ? c : least; // NaN too
        c = c < 1.0f ? c : 1.0f;
        uint32_t bits;
        memcpy(&bits, &c, sizeof bits);
        shown[i] = (uint8_t)((bits + bins[(bits >> HALF) - FIRST]) >> HALF);
    }
}

// Two lanes' bins: an element is asked for by its own load, of which 8 lanes take 8.2 TSC cycles where the gather's
// take 10.6 (Zen 3, samples in its nearest cache, by turns).
__attribute__((target("avx2"))) static inline __m128i two_bins(const uint32_t *bins,
                                                               uint64_t places) {
    __m128i one = _mm_cvtsi32_si128((int)bins[(size_t)(uint32_t)places - FIRST]);
    return _mm_insert_epi32(one, (int)bins[(size_t)(places >> 32) - FIRST], 1);
}

__attribute__((target("avx2"))) static inline __m128i four_bins(const uint32_t *bins,
                                                                __m128i places) {
    return _mm_unpacklo_epi64(two_bins(bins, (uint64_t)_mm_cvtsi128_si64(places)),
                              two_bins(bins, (uint64_t)_mm_extract_epi64(places, 1)));
}

__attribute__((target("avx2"))) static inline void by_8(const uint32_t *bins, const float *linear,
                                                        size_t samples, uint8_t *shown, bool far) {
    const __m256 least = _mm256_castsi256_ps(_mm256_set1_epi32(FIRST << HALF));
    // The third byte of each 32-bit lane, of 128 bits at a time.
    const __m256i bytes = _mm256_broadcastsi128_si256(
        _mm_setr_epi8(2, 6, 10, 14, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1));
    size_t i = 0;
    for (; i + 8 <= samples; i += 8) {
        if (far)
            fetch_ahead(linear + i);
        // maxps returns its second operand where the first is NaN.
        __m256 c = _mm256_max_ps(_mm256_loadu_ps(linear + i), least);
        __m256i bits = _mm256_castps_si256(_mm256_min_ps(c, _mm256_set1_ps(1.0f)));
        __m256i place = _mm256_srli_epi32(bits, HALF);
        __m128i low = four_bins(bins, _mm256_castsi256_si128(place)),
                high = four_bins(bins, _mm256_extracti128_si256(place, 1));
        __m256i bin = _mm256_inserti128_si256(_mm256_castsi128_si256(low), high, 1);
        __m256i byte = _mm256_shuffle_epi8(_mm256_add_epi32(bits, bin), bytes);
        __m128i both =
            _mm_unpacklo_epi32(_mm256_castsi256_si128(byte), _mm256_extracti128_si256(byte, 1));
        _mm_storel_epi64((__m128i *)(shown + i), both);
    }
    _mm256_zeroupper(); // see by_16
    one_by_one(bins, linear + i, samples - i, shown + i);
}

__attribute__((target("avx512f"))) static inline void
by_16(const uint32_t *bins, const float *linear, size_t samples, uint8_t *shown, bool far) {
    const __m512 least = _mm512_castsi512_ps(_mm512_set1_epi32(FIRST << HALF));
    size_t i = 0;
    for (; i + 16 <= samples; i += 16) {
        if (far)
            fetch_ahead(linear + i);
        __m512 c = _mm512_max_ps(_mm512_loadu_ps(linear + i), least);
        __m512i bits = _mm512_castps_si512(_mm512_min_ps(c, _mm512_set1_ps(1.0f)));
        __m512i place = _mm512_sub_epi32(_mm512_srli_epi32(bits, HALF), _mm512_set1_epi32(FIRST));
        __m512i bin = _mm512_i32gather_epi32(place, bins, 4);
        __m512i byte = _mm512_srli_epi32(_mm512_add_epi32(bits, bin), HALF);
        _mm_storeu_si128((__m128i *)(shown + i), _mm512_cvtepi32_epi8(byte));
    }
    // gcc 12 leaves it out before a call in last place of a function that is built for AVX in a file that is not.
    // With upper halves in use every SSE instruction of the next frame keeps them: it waits for its register's last
    // writer (Intel's optimization manual, "Mixing AVX code with SSE code"), and scalar frames took 3 to 10 times
    // as long on Emerald Rapids (results/reference/README.md).
    _mm256_zeroupper();
    one_by_one(bins, linear + i, samples - i, shown + i);
}

__attribute__((target("avx2"))) static void far_by_8(const uint32_t *bins, const float *linear,
                                                     size_t samples, uint8_t *shown) {
    by_8(bins, linear, samples, shown, true);
}

__attribute__((target("avx2"))) static void near_by_8(const uint32_t *bins, const float *linear,
                                                      size_t samples, uint8_t *shown) {
    by_8(bins, linear, samples, shown, false);
}

__attribute__((target("avx512f"))) static void far_by_16(const uint32_t *bins, const float *linear,
                                                         size_t samples, uint8_t *shown) {
    by_16(bins, linear, samples, shown, true);
}

__attribute__((target("avx512f"))) static void near_by_16(const uint32_t *bins, const float *linear,
                                                          size_t samples, uint8_t *shown) {
    by_16(bins, linear, samples, shown, false);
}

// STEPWISE_ISA_LIMIT stands for a smaller CPU, as it does for the phases (variant.h).
static void choose_widest(struct presenter *p) {
    const char *limit = getenv("STEPWISE_ISA_LIMIT");
    bool none = limit && strcmp(limit, "none") == 0, narrow = limit && strcmp(limit, "avx2") == 0;
    __builtin_cpu_init();
    p->far = p->near = one_by_one;
    if (!none && !narrow && __builtin_cpu_supports("avx512f")) {
        p->far = far_by_16;
        p->near = near_by_16;
    } else if (!none && __builtin_cpu_supports("avx2")) {
        p->far = far_by_8;
        p->near = near_by_8;
    }
}

struct presenter *presenter_create(int threads) {
    struct presenter *p = malloc(sizeof *p);
    if (!p)
        return NULL;
    choose_widest(p);
    p->threads = sched_getaffinity(0, sizeof p->cpus, &p->cpus) == 0 ? threads : 1;
    for (uint32_t bin = FIRST; bin <= LAST; bin++)
        p->bins[bin - FIRST] = ((uint32_t)level(from_bits(bin << HALF)) - bin) << HALF;
    for (int k = 1; k < 256; k++) {
        uint32_t bits = threshold(k), low = bits & (CARRY - 1);
        if (low > 0) // else its bin begins with it
            p->bins[(bits >> HALF) - FIRST] += CARRY - low;
    }
    return p;
}

void presenter_free(struct presenter *presenter) {
    free(presenter);
}

// What a thread does of a picture.
struct part {
    const struct presenter *presenter;
    const float *linear;
    size_t samples;
    uint8_t *shown;
};

static void *present_part(void *data) {
    const struct part *p = data;
    p->presenter->far(p->presenter->bins, p->linear, p->samples, p->shown);
    return NULL;
}

// Another thread for `part`, where the process may run.
static bool begin_part(pthread_t *thread, struct part *part) {
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes) != 0)
        return false;
    const cpu_set_t *cpus = &part->presenter->cpus;
    bool begun = pthread_attr_setaffinity_np(&attributes, sizeof *cpus, cpus) == 0 &&
                 pthread_create(thread, &attributes, present_part, part) == 0;
    pthread_attr_destroy(&attributes);
    return begun;
}

void presenter_show(const struct presenter *presenter, const float *linear, size_t samples,
                    uint8_t *shown) {
    presenter->near(presenter->bins, linear, samples, shown);
}

void frame_present(const struct presenter *presenter, const struct frame *frame, uint8_t *rgb8) {
    const size_t samples = 3 * (size_t)frame->width * (size_t)frame->height;
    size_t count = samples / APIECE < MOST ? samples / APIECE : MOST;
    if (count > (size_t)presenter->threads)
        count = (size_t)presenter->threads;
    size_t each = count > 1 ? samples / count / WHOLE_LINES * WHOLE_LINES : 0;
    struct part parts[MOST];
    pthread_t threads[MOST];
    size_t begun =
        0; // behind one another; the caller has the rest, which is all of them if no thread begins
    for (; begun + 1 < count; begun++) {
        size_t at = begun * each;
        parts[begun] = (struct part){presenter, frame->rgb + at, each, rgb8 + at};
        if (!begin_part(&threads[begun], &parts[begun]))
            break;
    }
    size_t at = begun * each;
    presenter->far(presenter->bins, frame->rgb + at, samples - at, rgb8 + at);
    for (size_t i = 0; i < begun; i++)
        pthread_join(threads[i], NULL);
}
