// Eight lanes: AVX2 or NEON. See simd.h.
#pragma once

#ifndef __aarch64__
static inline void v_store_block(float *rgb, size_t stride, vfloat r, vfloat g, vfloat b) {
    // In each half of a register (a row) r0 r2 g0 g2, g1 g3 b1 b3, b0 b2 r1 r3.
    vfloat rg = _mm256_shuffle_ps(r, g, _MM_SHUFFLE(2, 0, 2, 0));
    vfloat gb = _mm256_shuffle_ps(g, b, _MM_SHUFFLE(3, 1, 3, 1));
    vfloat br = _mm256_shuffle_ps(b, r, _MM_SHUFFLE(3, 1, 2, 0));
    const vfloat third[3] = {_mm256_shuffle_ps(rg, br, _MM_SHUFFLE(2, 0, 2, 0)),  // r0 g0 b0 r1
                             _mm256_shuffle_ps(gb, rg, _MM_SHUFFLE(3, 1, 2, 0)),  // g1 b1 r2 g2
                             _mm256_shuffle_ps(br, gb, _MM_SHUFFLE(3, 1, 3, 1))}; // b2 r3 g3 b3
    for (int i = 0; i < 3; i++) {
        _mm_storeu_ps(rgb + 4 * i, _mm256_castps256_ps128(third[i]));
        _mm_storeu_ps(rgb + stride + 4 * i, _mm256_extractf128_ps(third[i], 1));
    }
}

static inline vfloat v_load_block_row(const float *from) {
    __m256 a = _mm256_castps128_ps256(_mm_loadu_ps(from));
    return _mm256_insertf128_ps(a, _mm_loadu_ps(from + 8), 1);
}

static inline void v_store_row(float *rgb, bool stream, vfloat r, vfloat g, vfloat b) {
    // In each half of a register (four pixels) as in v_store_block.
    vfloat rg = _mm256_shuffle_ps(r, g, _MM_SHUFFLE(2, 0, 2, 0));
    vfloat gb = _mm256_shuffle_ps(g, b, _MM_SHUFFLE(3, 1, 3, 1));
    vfloat br = _mm256_shuffle_ps(b, r, _MM_SHUFFLE(3, 1, 2, 0));
    vfloat first = _mm256_shuffle_ps(rg, br, _MM_SHUFFLE(2, 0, 2, 0));
    vfloat second = _mm256_shuffle_ps(gb, rg, _MM_SHUFFLE(3, 1, 2, 0));
    vfloat third = _mm256_shuffle_ps(br, gb, _MM_SHUFFLE(3, 1, 3, 1));
    v_store_or_stream(rgb, stream, _mm256_permute2f128_ps(first, second, 0x20));
    v_store_or_stream(rgb + 8, stream, _mm256_permute2f128_ps(third, first, 0x30));
    v_store_or_stream(rgb + 16, stream, _mm256_permute2f128_ps(second, third, 0x31));
}
#else
// st3 stores three registers interleaved.
static inline void v_store_block(float *rgb, size_t stride, vfloat r, vfloat g, vfloat b) {
    vregisters x = v_split(r), y = v_split(g), z = v_split(b);
    EACH_REGISTER(i) {
        float32x4x3_t pixels = {{x.of[i], y.of[i], z.of[i]}};
        vst3q_f32(rgb + (size_t)i * stride, pixels);
    }
}

static inline vfloat v_load_block_row(const float *from) {
    return v_join((vregisters){{vld1q_f32(from), vld1q_f32(from + 8)}});
}

static inline void v_store_row(float *rgb, bool stream, vfloat r, vfloat g, vfloat b) {
    (void)stream;
    v_store_block(rgb, 12, r, g, b);
}
#endif
