// Eight lanes: AVX2 or NEON. See simd.h.
#pragma once

// By a table: no branch predictor foresees where a loop over bits ends.
#define SIMD_PACK_LANE(m, lane)                                                                    \
    ((m) >> (lane) & 1 ? (lane##ull) << 8 * __builtin_popcount((m) & ((1u << (lane)) - 1)) : 0)
#define SIMD_PACK_1(m)                                                                             \
    (SIMD_PACK_LANE(m, 0) | SIMD_PACK_LANE(m, 1) | SIMD_PACK_LANE(m, 2) | SIMD_PACK_LANE(m, 3) |   \
     SIMD_PACK_LANE(m, 4) | SIMD_PACK_LANE(m, 5) | SIMD_PACK_LANE(m, 6) | SIMD_PACK_LANE(m, 7))
#define SIMD_PACK_4(m)                                                                             \
    SIMD_PACK_1(m), SIMD_PACK_1((m) + 1), SIMD_PACK_1((m) + 2), SIMD_PACK_1((m) + 3)
#define SIMD_PACK_16(m)                                                                            \
    SIMD_PACK_4(m), SIMD_PACK_4((m) + 4), SIMD_PACK_4((m) + 8), SIMD_PACK_4((m) + 12)
#define SIMD_PACK_64(m)                                                                            \
    SIMD_PACK_16(m), SIMD_PACK_16((m) + 16), SIMD_PACK_16((m) + 32), SIMD_PACK_16((m) + 48)

static const unsigned long long simd_packed_lanes[256] = {SIMD_PACK_64(0), SIMD_PACK_64(64),
                                                          SIMD_PACK_64(128), SIMD_PACK_64(192)};

#ifndef __aarch64__
static inline vindex v_compress_index(vmask m) {
    return _mm256_cvtepu8_epi32(
        _mm_loadl_epi64((const __m128i *)&simd_packed_lanes[v_mask_bits(m)]));
}

static inline void v_permute_store(vindex index, vfloat a, float to[LANES]) {
    _mm256_storeu_ps(to, _mm256_permutevar8x32_ps(a, index));
}

static inline void v_compress_store_int(vmask m, const int from[LANES], int to[LANES]) {
    __m256i all = _mm256_loadu_si256((const __m256i *)from);
    _mm256_storeu_si256((__m256i *)to, _mm256_permutevar8x32_epi32(all, v_compress_index(m)));
}

static inline void v_compress_store_lanes(vmask m, int first, int shift, int to[LANES]) {
    __m256i numbers = _mm256_slli_epi32(v_compress_index(m), shift);
    _mm256_storeu_si256((__m256i *)to, _mm256_add_epi32(numbers, _mm256_set1_epi32(first)));
}

static inline vindex v_index_u16(vmask m, const unsigned short from[LANES]) {
    __m256i numbers = _mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)from));
    return _mm256_blendv_epi8(_mm256_set1_epi32(from[0]), numbers, _mm256_castps_si256(m.bits));
}

static inline vfloat v_gather(const float *from, vindex index) {
    return _mm256_i32gather_ps(from, index, sizeof *from);
}

#else
static inline vindex v_of_u16(uint16x8_t a) {
    vregisters x = {{vreinterpretq_f32_u32(vmovl_u16(vget_low_u16(a))),
                     vreinterpretq_f32_u32(vmovl_high_u16(a))}};
    return BITS(v_join(x));
}

// Lane index[i] of a in lane i.
static inline vfloat v_permuted(vindex index, vfloat a) {
    vindex each = index * 0x04040404 + 0x03020100; // the four bytes of each lane
    vregisters bytes = v_split(FLOATS(each)), from = v_split(a), to;
    uint8x16x2_t table = {{vreinterpretq_u8_f32(from.of[0]), vreinterpretq_u8_f32(from.of[1])}};
    EACH_REGISTER(i)
    to.of[i] = vreinterpretq_f32_u8(vqtbl2q_u8(table, vreinterpretq_u8_f32(bytes.of[i])));
    return v_join(to);
}

static inline void v_permute_store(vindex index, vfloat a, float to[LANES]) {
    v_store(v_permuted(index, a), to);
}

static inline vindex v_compress_index(vmask m) {
    return v_of_u16(vmovl_u8(vcreate_u8(simd_packed_lanes[v_mask_bits(m)])));
}

static inline void v_compress_store_int(vmask m, const int from[LANES], int to[LANES]) {
    vfloat all = FLOATS(*(const unaligned_vindex *)from);
    *(unaligned_vindex *)to = BITS(v_permuted(v_compress_index(m), all));
}

static inline void v_compress_store_lanes(vmask m, int first, int shift, int to[LANES]) {
    *(unaligned_vindex *)to = (v_compress_index(m) << shift) + first;
}

static inline vindex v_index_u16(vmask m, const unsigned short from[LANES]) {
    vindex first = V_ALL(from[0]);
    return BITS(v_select(m, FLOATS(v_of_u16(vld1q_u16(from))), FLOATS(first)));
}

static inline vfloat v_gather(const float *from, vindex index) {
    return (vfloat){from[index[0]], from[index[1]], from[index[2]], from[index[3]],
                    from[index[4]], from[index[5]], from[index[6]], from[index[7]]};
}
#endif

static inline vfloat v_expand_load(vmask m, vfloat a, const float *from) {
    float lanes[LANES];
    v_store(a, lanes);
    for (unsigned rest = v_mask_bits(m); rest; rest &= rest - 1)
        lanes[__builtin_ctz(rest)] = *from++;
    return v_load(lanes);
}

static inline void v_expand_rows(vfloat *to, int count, unsigned lanes, const float *from,
                                 int stride) {
    for (; lanes; lanes &= lanes - 1, from++) {
        float *lane = (float *)to + __builtin_ctz(lanes);
        for (int i = 0; i < count; i++)
            lane[i * LANES] = from[(size_t)i * (size_t)stride];
    }
}

static inline void v_move_lanes(float *to, unsigned there, const float *from, unsigned here,
                                int count) {
    for (; here; here &= here - 1, there &= there - 1)
        for (int i = 0; i < count; i++)
            to[i * LANES + __builtin_ctz(there)] = from[i * LANES + __builtin_ctz(here)];
}
