// Sixteen lanes: AVX-512 F and DQ. See simd.h.
#pragma once

// A permutation is one instruction of one step; to compress or to expand is two. So the lanes' numbers are
// compressed once, for all rows that move alike.
static inline __m512i v_lane_index(void) {
    return _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}

static inline vindex v_compress_index(vmask m) {
    return _mm512_maskz_compress_epi32(m.bits, v_lane_index());
}

static inline void v_permute_store(vindex index, vfloat a, float to[LANES]) {
    _mm512_storeu_ps(to, _mm512_permutexvar_ps(index, a));
}

static inline void v_compress_store_int(vmask m, const int from[LANES], int to[LANES]) {
    _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(m.bits, _mm512_loadu_si512(from)));
}

static inline void v_compress_store_lanes(vmask m, int first, int shift, int to[LANES]) {
    __m512i numbers = _mm512_slli_epi32(v_compress_index(m), (unsigned)shift);
    _mm512_storeu_si512(to, _mm512_add_epi32(numbers, _mm512_set1_epi32(first)));
}

static inline vindex v_index_u16(vmask m, const unsigned short from[LANES]) {
    __m256i low = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)from));
    __m256i high = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)from + 1));
    vfloat numbers = _mm512_insertf32x8(_mm512_castps256_ps512(_mm256_castsi256_ps(low)),
                                        _mm256_castsi256_ps(high), 1);
    vfloat first = _mm512_castsi512_ps(_mm512_set1_epi32(from[0]));
    return _mm512_castps_si512(v_select(m, numbers, first));
}

static inline vfloat v_gather(const float *from, vindex index) {
    return _mm512_i32gather_ps(index, from, sizeof *from);
}

static inline vfloat v_expand_load(vmask m, vfloat a, const float *from) {
    return _mm512_mask_expandloadu_ps(a, m.bits, from);
}

// Which lane of two registers each lane is to hold: its own of the first or, in the lanes `there`, one of the
// second: the lanes `here` in their order.
static inline __m512i v_index_taken(unsigned there, unsigned here) {
    __m512i second = _mm512_add_epi32(v_lane_index(), _mm512_set1_epi32(LANES));
    return _mm512_mask_expand_epi32(v_lane_index(), (__mmask16)there,
                                    _mm512_maskz_compress_epi32((__mmask16)here, second));
}

static inline void v_expand_rows(vfloat *to, int count, unsigned lanes, const float *from,
                                 int stride) {
    __m512i taken = v_index_taken(lanes, 0xffff);
    for (int i = 0; i < count; i++)
        to[i] = _mm512_permutex2var_ps(to[i], taken, v_load(from + (size_t)i * (size_t)stride));
}

static inline void v_move_lanes(float *to, unsigned there, const float *from, unsigned here,
                                int count) {
    __m512i taken = v_index_taken(there, here);
    for (int i = 0; i < count; i++, to += LANES, from += LANES)
        v_store(_mm512_permutex2var_ps(v_load(to), taken, v_load(from)), to);
}
