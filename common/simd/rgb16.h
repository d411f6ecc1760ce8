// Sixteen lanes: AVX-512 F and DQ. See simd.h.
#pragma once

static inline void v_store_block(float *rgb, size_t stride, vfloat r, vfloat g, vfloat b) {
    const __m512i rg = _mm512_setr_epi32(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 0, 0, 0, 0);
    const __m512i to_b = _mm512_setr_epi32(0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 0, 0, 0, 0);
    for (int row = 0; row < 4; row++) {
        __m512i from = _mm512_set1_epi32(4 * row);
        __m512 two = _mm512_permutex2var_ps(r, _mm512_add_epi32(rg, from), g);
        __m512i blue = _mm512_mask_add_epi32(to_b, 0x924, to_b, from);
        _mm512_mask_storeu_ps(rgb + (size_t)row * stride, 0xfff,
                              _mm512_permutex2var_ps(two, blue, b));
    }
}

static inline vfloat v_load_block_row(const float *from) {
    __m512 a = _mm512_castps128_ps512(_mm_loadu_ps(from));
    a = _mm512_insertf32x4(a, _mm_loadu_ps(from + 16), 1);
    a = _mm512_insertf32x4(a, _mm_loadu_ps(from + 32), 2);
    return _mm512_insertf32x4(a, _mm_loadu_ps(from + 48), 3);
}

static inline void v_store_row(float *rgb, bool stream, vfloat r, vfloat g, vfloat b) {
    // Which lanes of each of the three registers come from red, which from green (from 16 on), then which from blue.
    const __m512i rg[3] = {
        _mm512_setr_epi32(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5),
        _mm512_setr_epi32(21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26),
        _mm512_setr_epi32(0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0)};
    const __m512i to_b[3] = {
        _mm512_setr_epi32(0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15),
        _mm512_setr_epi32(0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15),
        _mm512_setr_epi32(26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31)};
    for (int i = 0; i < 3; i++)
        v_store_or_stream(rgb + 16 * i, stream,
                          _mm512_permutex2var_ps(_mm512_permutex2var_ps(r, rg[i], g), to_b[i], b));
}
