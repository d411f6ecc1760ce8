// What each intrinsic of 16 lanes makes of given operands, for tests/common/test_emulated.py: blocks of `struct given` from
// standard input, for each 64 bytes an intrinsic to standard output, in the order that `each names` prints. Built
// with tests/emulate before the compiler's own header, and without it where the CPU has AVX-512.
#include <immintrin.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>

struct given {
    float a[16], b[16], c[16];
    double d[8];
    int64_t p[8], q[8];
    int32_t at[16];
    uint32_t k, l;
};

static int names_only;

static void out(const char *name, const void *value, size_t size) {
    char row[64] = {0};
    if (size)
        memcpy(row, value, size);
    if (names_only)
        puts(name);
    else
        fwrite(row, sizeof row, 1, stdout);
}

#define OUT(name, type, value)                                                                     \
    do {                                                                                           \
        type made = value;                                                                         \
        out(name, &made, sizeof made);                                                             \
    } while (0)

static void floats(__m512 a, __m512 b, __m512 c, unsigned k) {
    __mmask16 m = (__mmask16)k;
    OUT("mul_add_operators", __m512, a * b + c);
    OUT("add_ps", __m512, _mm512_add_ps(a, b));
    OUT("mask_add_ps", __m512, _mm512_mask_add_ps(c, m, a, b));
    OUT("min_ps", __m512, _mm512_min_ps(a, b));
    OUT("max_ps", __m512, _mm512_max_ps(a, b));
    OUT("and_ps", __m512, _mm512_and_ps(a, b));
    OUT("or_ps", __m512, _mm512_or_ps(a, b));
    OUT("andnot_ps", __m512, _mm512_andnot_ps(a, b));
    OUT("mask_xor_ps", __m512, _mm512_mask_xor_ps(c, m, a, b));
    OUT("mask_blend_ps", __m512, _mm512_mask_blend_ps(m, a, b));
    OUT("maskz_mov_ps", __m512, _mm512_maskz_mov_ps(m, a));
    OUT("fmadd_ps", __m512, _mm512_fmadd_ps(a, b, c));
    OUT("fmsub_ps", __m512, _mm512_fmsub_ps(a, b, c));
    OUT("fnmadd_ps", __m512, _mm512_fnmadd_ps(a, b, c));
    OUT("mask_fmadd_ps", __m512, _mm512_mask_fmadd_ps(a, m, b, c));
    OUT("sqrt_ps", __m512, _mm512_sqrt_ps(a));
    OUT("floor_ps", __m512, _mm512_floor_ps(a));
    OUT("roundscale_ps", __m512,
        _mm512_roundscale_ps(a, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC));
    OUT("getexp_ps", __m512, _mm512_getexp_ps(a));
    OUT("getmant_ps", __m512, _mm512_getmant_ps(a, _MM_MANT_NORM_p75_1p5, _MM_MANT_SIGN_src));
    OUT("rsqrt14_ps", __m512, _mm512_rsqrt14_ps(a));
    OUT("rcp14_ps", __m512, _mm512_rcp14_ps(a));
    OUT("reduce_min_ps", float, _mm512_reduce_min_ps(b));
    OUT("reduce_max_ps", float, _mm512_reduce_max_ps(b));
    OUT("cmp_lt", __mmask16, _mm512_cmp_ps_mask(a, b, _CMP_LT_OQ));
    OUT("cmp_gt", __mmask16, _mm512_cmp_ps_mask(a, b, _CMP_GT_OQ));
    OUT("cmp_ge", __mmask16, _mm512_cmp_ps_mask(a, b, _CMP_GE_OQ));
    OUT("cmp_eq", __mmask16, _mm512_cmp_ps_mask(a, b, _CMP_EQ_OQ));
    OUT("mask_cmp_ngt", __mmask16, _mm512_mask_cmp_ps_mask(m, a, b, _CMP_NGT_UQ));
    OUT("maskz_compress_ps", __m512, _mm512_maskz_compress_ps(m, a));
    OUT("mask_expand_ps", __m512, _mm512_mask_expand_ps(b, m, a));
    OUT("cvtss_f32", float, _mm512_cvtss_f32(a));
    OUT("extractf32x8_ps", __m256, _mm512_extractf32x8_ps(a, 1));
    OUT("castps512_ps256", __m256, _mm512_castps512_ps256(a));
    OUT("insertf32x8", __m512, _mm512_insertf32x8(a, _mm512_castps512_ps256(b), 1));
    OUT("insertf32x4", __m512,
        _mm512_insertf32x4(a, _mm256_castps256_ps128(_mm512_castps512_ps256(b)), 2));
    OUT("cvtps_epi32", __m512i, _mm512_cvtps_epi32(a));
    OUT("cvtps_pd", __m512d, _mm512_cvtps_pd(_mm512_castps512_ps256(a)));
    OUT("movepi32_mask", __mmask16, _mm512_movepi32_mask(_mm512_castps_si512(a)));
}

static void wholes(const struct given *in) {
    __m512i p = _mm512_loadu_si512(in->p), q = _mm512_loadu_si512(in->q);
    __m512i at = _mm512_loadu_si512(in->at);
    __m512 a = _mm512_loadu_ps(in->a), b = _mm512_loadu_ps(in->b);
    OUT("cvtepi32_ps", __m512, _mm512_cvtepi32_ps(p));
    OUT("cvtepi64_pd", __m512d, _mm512_cvtepi64_pd(p));
    OUT("add_epi32", __m512i, _mm512_add_epi32(p, q));
    OUT("sub_epi32", __m512i, _mm512_sub_epi32(p, q));
    OUT("mask_add_epi32", __m512i, _mm512_mask_add_epi32(q, (__mmask16)in->k, p, p));
    OUT("maskz_compress_epi32", __m512i, _mm512_maskz_compress_epi32((__mmask16)in->k, p));
    OUT("mask_expand_epi32", __m512i, _mm512_mask_expand_epi32(q, (__mmask16)in->k, p));
    OUT("add_epi64", __m512i, _mm512_add_epi64(p, q));
    OUT("sub_epi64", __m512i, _mm512_sub_epi64(p, q));
    OUT("mul_epi32", __m512i, _mm512_mul_epi32(p, q));
    OUT("and_si512", __m512i, _mm512_and_si512(p, q));
    OUT("or_si512", __m512i, _mm512_or_si512(p, q));
    OUT("slli_epi32", __m512i, _mm512_slli_epi32(p, 23));
    OUT("srli_epi32", __m512i, _mm512_srli_epi32(p, 23));
    OUT("sllv_epi64", __m512i, _mm512_sllv_epi64(p, q));
    OUT("srlv_epi64", __m512i, _mm512_srlv_epi64(p, q));
    OUT("srav_epi64", __m512i, _mm512_srav_epi64(p, q));
    OUT("mask_blend_epi64", __m512i, _mm512_mask_blend_epi64((__mmask8)in->k, p, q));
    OUT("cmplt_epi64", __mmask8, _mm512_cmplt_epi64_mask(p, q));
    OUT("test_epi32", __mmask16, _mm512_test_epi32_mask(p, q));
    OUT("test_epi64", __mmask8, _mm512_test_epi64_mask(p, q));
    OUT("permutex2var_ps", __m512, _mm512_permutex2var_ps(a, at, b));
    OUT("permutexvar_ps", __m512, _mm512_permutexvar_ps(at, a));
    __m512i near = _mm512_and_si512(at, _mm512_set1_epi32(15));
    OUT("i32gather_ps", __m512, _mm512_i32gather_ps(near, in->a, 4));
    __m512i far = _mm512_and_si512(p, _mm512_set1_epi64(7));
    OUT("i64gather_epi64", __m512i, _mm512_i64gather_epi64(far, in->q, 8));
}

static void doubles(const double from[8]) {
    __m512d d = _mm512_loadu_pd(from), e = _mm512_set1_pd(1.5), f = _mm512_set1_pd(-1.0 / 3);
    OUT("cvtpd_ps", __m256, _mm512_cvtpd_ps(d));
    OUT("add_pd", __m512d, _mm512_add_pd(d, e));
    OUT("sqrt_pd", __m512d, _mm512_sqrt_pd(d));
    OUT("floor_pd", __m512d, _mm512_floor_pd(d));
    OUT("rsqrt14_pd", __m512d, _mm512_rsqrt14_pd(d));
    OUT("fmadd_pd", __m512d, _mm512_fmadd_pd(d, e, f));
    OUT("fnmadd_pd", __m512d, _mm512_fnmadd_pd(d, e, f));
}

static void masks(unsigned k, unsigned l) {
    __mmask16 m = (__mmask16)k, n = (__mmask16)l;
    __mmask8 s = (__mmask8)k, t = (__mmask8)l;
    OUT("kand16", __mmask16, _kand_mask16(m, n));
    OUT("kandn16", __mmask16, _kandn_mask16(m, n));
    OUT("kor16", __mmask16, _kor_mask16(m, n));
    OUT("knot16", __mmask16, _knot_mask16(m));
    OUT("kand8", __mmask8, _kand_mask8(s, t));
    OUT("kandn8", __mmask8, _kandn_mask8(s, t));
    OUT("kor8", __mmask8, _kor_mask8(s, t));
    OUT("cvtmask16_u32", uint32_t, _cvtmask16_u32(m));
    OUT("kortestz16", uint8_t, _kortestz_mask16_u8(m, n));
    OUT("kortestc16", uint8_t, _kortestc_mask16_u8(m, n));
    OUT("kortestz8", uint8_t, _kortestz_mask8_u8(s, t));
}

// Beside a page that may not be touched: what a mask leaves out must not be.
static void memory(const struct given *in, char *end) {
    __m512 a = _mm512_loadu_ps(in->a), b = _mm512_loadu_ps(in->b);
    int count = __builtin_popcount(in->k & 0xffff);
    char *from = end - sizeof(float) * (size_t)count;
    memcpy(from, in->c, sizeof(float) * (size_t)count);
    OUT("mask_expandloadu_ps", __m512, _mm512_mask_expandloadu_ps(b, (__mmask16)in->k, from));
    int highest = in->k & 0xffff ? 32 - __builtin_clz(in->k & 0xffff) : 0;
    char *to = end - sizeof(float) * (size_t)highest;
    memcpy(to, in->c, sizeof(float) * (size_t)highest);
    _mm512_mask_storeu_ps(to, (__mmask16)in->k, a);
    out("mask_storeu_ps", to, sizeof(float) * (size_t)highest);
    _mm512_stream_ps((float *)(end - sizeof a), a);
    out("stream_ps", end - sizeof a, sizeof a);
}

int main(int count, char **words) {
    (void)words;
    names_only = count > 1;
    char *pages = mmap(NULL, 8192, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (pages == MAP_FAILED || mprotect(pages + 4096, 4096, PROT_NONE) != 0)
        return 1;
    struct given in = {0};
    while (names_only || fread(&in, sizeof in, 1, stdin) == 1) {
        floats(_mm512_loadu_ps(in.a), _mm512_loadu_ps(in.b), _mm512_loadu_ps(in.c), in.k);
        wholes(&in);
        doubles(in.d);
        masks(in.k, in.l);
        memory(&in, pages + 4096);
        if (names_only)
            break;
    }
    return 0;
}
