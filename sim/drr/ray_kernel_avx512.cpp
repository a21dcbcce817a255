// Sixteen lanes: AVX-512 F, BW, DQ and VL.
#if defined(__x86_64__)

#include <immintrin.h>

#include "sim/drr/ray_kernel_lanes.h"

namespace kiroku::sim {
namespace {

struct Avx512 {
  static constexpr int kWidth = 16;
  using Real = __m512;
  using Whole = __m512i;

  static Real set(float x) { return _mm512_set1_ps(x); }
  static Whole set(std::int32_t x) { return _mm512_set1_epi32(x); }
  static Real counting() { return _mm512_setr_ps(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15); }
  static Real load(const float* from) { return _mm512_load_ps(from); }
  static Whole load(const std::int32_t* from) { return _mm512_load_si512(from); }
  static void store(float* to, Real x) { _mm512_store_ps(to, x); }
  static Real add(Real a, Real b) { return _mm512_add_ps(a, b); }
  static Real subtract(Real a, Real b) { return _mm512_sub_ps(a, b); }
  static Real multiply(Real a, Real b) { return _mm512_mul_ps(a, b); }
  static Real divide(Real a, Real b) { return _mm512_div_ps(a, b); }
  static Real fma(Real a, Real b, Real c) { return _mm512_fmadd_ps(a, b, c); }
  static Real min(Real a, Real b) { return _mm512_min_ps(a, b); }
  static Real max(Real a, Real b) { return _mm512_max_ps(a, b); }
  static Real magnitude(Real a) { return _mm512_abs_ps(a); }
  static Real not_near_zero(Real a) {
    const __mmask16 near = _mm512_cmp_ps_mask(_mm512_abs_ps(a), set(1e-6F), _CMP_NGE_UQ);
    return _mm512_mask_mov_ps(a, near, set(1e-6F));
  }
  static Whole add(Whole a, Whole b) { return _mm512_add_epi32(a, b); }
  static Whole subtract(Whole a, Whole b) { return _mm512_sub_epi32(a, b); }
  static Whole multiply(Whole a, Whole b) { return _mm512_mullo_epi32(a, b); }
  static Whole min(Whole a, Whole b) { return _mm512_min_epi32(a, b); }
  static Whole truncated(Real a) { return _mm512_cvttps_epi32(a); }
  static Real real(Whole a) { return _mm512_cvtepi32_ps(a); }
  static int greatest(Whole a) { return _mm512_reduce_max_epi32(a); }
  static Whole column_of(Whole pixel) { return _mm512_and_si512(pixel, set(kTileSide - 1)); }
  static Whole row_of(Whole pixel) { return _mm512_srli_epi32(pixel, 5); }
  static unsigned is_less(Real a, Real b) { return _mm512_cmp_ps_mask(a, b, _CMP_LT_OQ); }
  static int append(unsigned hit, Real entered, Real left, std::int32_t pixel, float* to_entered,
                    float* to_left, std::int32_t* to_pixel) {
    const auto mask = static_cast<__mmask16>(hit);
    const Whole pixels =
        _mm512_add_epi32(set(pixel), _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
    _mm512_storeu_ps(to_entered, _mm512_maskz_compress_ps(mask, entered));
    _mm512_storeu_ps(to_left, _mm512_maskz_compress_ps(mask, left));
    _mm512_storeu_si512(to_pixel, _mm512_maskz_compress_epi32(mask, pixels));
    return __builtin_popcount(hit);
  }
  /// Both weights of a pair, that of the next row above.
  static Whole weights(Real part) {
    const Whole next = _mm512_cvtps_epi32(_mm512_mul_ps(part, set(float(kRayWeight))));
    return _mm512_or_si512(_mm512_sub_epi32(set(kRayWeight), next), _mm512_slli_epi32(next, 16));
  }
  static Whole weighted(Whole pairs, Whole weights) { return _mm512_madd_epi16(pairs, weights); }
  static __m128i two(const std::uint32_t* quads, const std::int32_t* at) {
    const __m128i first = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(quads + at[0]));
    return _mm_castps_si128(
        _mm_loadh_pi(_mm_castsi128_ps(first), reinterpret_cast<const __m64*>(quads + at[1])));
  }
  static __m256i four(const std::uint32_t* quads, const std::int32_t* at) {
    return _mm256_inserti128_si256(_mm256_castsi128_si256(two(quads, at)), two(quads, at + 2), 1);
  }
  static __m512i eight(const std::uint32_t* quads, const std::int32_t* at) {
    return _mm512_inserti64x4(_mm512_castsi256_si512(four(quads, at)), four(quads, at + 4), 1);
  }
  static void gather(const std::uint32_t* quads, Whole element, Whole& left, Whole& right) {
    // Sixteen loads of eight bytes are faster than the instruction that gathers, on all processors tried.
    alignas(64) std::int32_t at[kWidth];
    _mm512_store_si512(at, element);
    const __m512i low = eight(quads, at), high = eight(quads, at + 8);
    left = _mm512_permutex2var_epi32(
        low, _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30), high);
    right = _mm512_permutex2var_epi32(
        low, _mm512_setr_epi32(1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31), high);
  }
};
static_assert(kTileSide == 32, "row_of() shifts by 5");

}  // namespace

extern const ProjectCells kProjectCellsAvx512;
const ProjectCells kProjectCellsAvx512 = &project_cells<Avx512>;

}  // namespace kiroku::sim

#endif
