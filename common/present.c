// Gamma and 8 bits: a float is shown by finding its place among 255 thresholds, to the bit as the formula in
// double has it. The bits of a positive float grow with its value: their upper half names a bin that has at
// most one threshold in it (a bin of a binade is 1/128 of its start wide, two thresholds at 0.5 to 1 are 1.1 %
// apart at the least), the lower half is compared with it. One table look-up a sample, 16, 8 or one at a time.
#include <immintrin.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "frame.h"

// Bins of the floats from FIRST << HALF, below the first threshold, to 1. A bin's word is the byte of its start,
// left of the lower half from which on it is one more (NEVER: it has no threshold), in LOW bits.
enum { HALF = 16, LOW = 17, NEVER = 1 << HALF, FIRST = 0x3600, LAST = 0x3f80 };

// A look-up's sixteen loads leave the CPU no room to see far ahead, and a picture is larger than its nearer caches:
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
    convert *convert;
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
        uint32_t bin = bins[(bits >> HALF) - FIRST];
        shown[i] = (uint8_t)((bin >> LOW) + ((bits & (NEVER - 1)) >= (bin & ((1u << LOW) - 1))));
    }
}

__attribute__((target("avx2"))) static void by_8(const uint32_t *bins, const float *linear,
                                                 size_t samples, uint8_t *shown) {
    const __m256 least = _mm256_castsi256_ps(_mm256_set1_epi32(FIRST << HALF));
    // The lowest byte of each 32-bit lane, of 128 bits at a time.
    const __m256i bytes = _mm256_broadcastsi128_si256(
        _mm_setr_epi8(0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1));
    size_t i = 0;
    for (; i + 8 <= samples; i += 8) {
        fetch_ahead(linear + i);
        // maxps returns its second operand where the first is NaN.
        __m256 c = _mm256_max_ps(_mm256_loadu_ps(linear + i), least);
        __m256i bits = _mm256_castps_si256(_mm256_min_ps(c, _mm256_set1_ps(1.0f)));
        __m256i place = _mm256_sub_epi32(_mm256_srli_epi32(bits, HALF), _mm256_set1_epi32(FIRST));
        __m256i bin = _mm256_i32gather_epi32((const int *)bins, place, 4);
        __m256i from = _mm256_and_si256(bin, _mm256_set1_epi32((1 << LOW) - 1));
        __m256i low = _mm256_and_si256(bits, _mm256_set1_epi32(NEVER - 1));
        __m256i before = _mm256_cmpgt_epi32(from, low); // -1 where it is not one more
        __m256i byte = _mm256_add_epi32(_mm256_srli_epi32(bin, LOW),
                                        _mm256_add_epi32(before, _mm256_set1_epi32(1)));
        byte = _mm256_shuffle_epi8(byte, bytes);
        __m128i both =
            _mm_unpacklo_epi32(_mm256_castsi256_si128(byte), _mm256_extracti128_si256(byte, 1));
        _mm_storel_epi64((__m128i *)(shown + i), both);
    }
    _mm256_zeroupper(); // see by_16
    one_by_one(bins, linear + i, samples - i, shown + i);
}

__attribute__((target("avx512f"))) static void by_16(const uint32_t *bins, const float *linear,
                                                     size_t samples, uint8_t *shown) {
    const __m512 least = _mm512_castsi512_ps(_mm512_set1_epi32(FIRST << HALF));
    size_t i = 0;
    for (; i + 16 <= samples; i += 16) {
        fetch_ahead(linear + i);
        __m512 c = _mm512_max_ps(_mm512_loadu_ps(linear + i), least);
        __m512i bits = _mm512_castps_si512(_mm512_min_ps(c, _mm512_set1_ps(1.0f)));
        __m512i place = _mm512_sub_epi32(_mm512_srli_epi32(bits, HALF), _mm512_set1_epi32(FIRST));
        __m512i bin = _mm512_i32gather_epi32(place, bins, 4);
        __m512i from = _mm512_and_epi32(bin, _mm512_set1_epi32((1 << LOW) - 1));
        __m512i low = _mm512_and_epi32(bits, _mm512_set1_epi32(NEVER - 1));
        __m512i byte = _mm512_srli_epi32(bin, LOW);
        byte = _mm512_mask_add_epi32(byte, _mm512_cmpge_epi32_mask(low, from), byte,
                                     _mm512_set1_epi32(1));
        _mm_storeu_si128((__m128i *)(shown + i), _mm512_cvtepi32_epi8(byte));
    }
    // gcc 12 leaves it out before a call in last place of a function that is built for AVX in a file that is not.
    // With upper halves in use every SSE instruction of the next frame keeps them: it waits for its register's last
    // writer (Intel's optimization manual, "Mixing AVX code with SSE code"), and scalar frames took 3 to 10 times
    // as long on Emerald Rapids (results/reference/README.md).
    _mm256_zeroupper();
    one_by_one(bins, linear + i, samples - i, shown + i);
}

// STEPWISE_ISA_LIMIT stands for a smaller CPU, as it does for the phases (variant.h).
static convert *widest(void) {
    const char *limit = getenv("STEPWISE_ISA_LIMIT");
    bool none = limit && strcmp(limit, "none") == 0, narrow = limit && strcmp(limit, "avx2") == 0;
    __builtin_cpu_init();
    if (!none && !narrow && __builtin_cpu_supports("avx512f"))
        return by_16;
    return !none && __builtin_cpu_supports("avx2") ? by_8 : one_by_one;
}

struct presenter *presenter_create(int threads) {
    struct presenter *p = malloc(sizeof *p);
    if (!p)
        return NULL;
    p->convert = widest();
    p->threads = sched_getaffinity(0, sizeof p->cpus, &p->cpus) == 0 ? threads : 1;
    for (uint32_t bin = FIRST; bin <= LAST; bin++)
        p->bins[bin - FIRST] = (uint32_t)level(from_bits(bin << HALF)) << LOW | NEVER;
    for (int k = 1; k < 256; k++) {
        uint32_t bits = threshold(k), low = bits & (NEVER - 1);
        if (low > 0) // else its bin begins with it
            p->bins[(bits >> HALF) - FIRST] = (uint32_t)(k - 1) << LOW | low;
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
    p->presenter->convert(p->presenter->bins, p->linear, p->samples, p->shown);
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
    presenter->convert(presenter->bins, frame->rgb + at, samples - at, rgb8 + at);
    for (size_t i = 0; i < begun; i++)
        pthread_join(threads[i], NULL);
}
