// Eight lanes: AVX2 and FMA.
#if defined(__x86_64__)

#include <immintrin.h>

#include "sim/drr/ray_kernel_lanes.h"

namespace kiroku::sim {
namespace {

struct Avx2 {
  static constexpr int kWidth = 8;
  using Real = __m256;
  using Whole = __m256i;

  static Real set(float x) { return _mm256_set1_ps(x); }
  static Whole set(std::int32_t x) { return _mm256_set1_epi32(x); }
  static Real counting() { return _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7); }
  static Real load(const float* from) { return _mm256_load_ps(from); }
  static Whole load(const std::int32_t* from) {
    return _mm256_load_si256(reinterpret_cast<const __m256i*>(from));
  }
  static void store(float* to, Real x) { _mm256_store_ps(to, x); }
  static Real add(Real a, Real b) { return _mm256_add_ps(a, b); }
  static Real subtract(Real a, Real b) { return _mm256_sub_ps(a, b); }
  static Real multiply(Real a, Real b) { return _mm256_mul_ps(a, b); }
  static Real divide(Real a, Real b) { return _mm256_div_ps(a, b); }
  static Real fma(Real a, Real b, Real c) { return _mm256_fmadd_ps(a, b, c); }
  static Real min(Real a, Real b) { return _mm256_min_ps(a, b); }
  static Real max(Real a, Real b) { return _mm256_max_ps(a, b); }
  static Real magnitude(Real a) { return _mm256_andnot_ps(set(-0.0F), a); }
  static Real not_near_zero(Real a) {
    const Real near = _mm256_cmp_ps(magnitude(a), set(1e-6F), _CMP_NGE_UQ);
    return _mm256_blendv_ps(a, set(1e-6F), near);
  }
  static Whole add(Whole a, Whole b) { return _mm256_add_epi32(a, b); }
  static Whole subtract(Whole a, Whole b) { return _mm256_sub_epi32(a, b); }
  static Whole multiply(Whole a, Whole b) { return _mm256_mullo_epi32(a, b); }
  static Whole min(Whole a, Whole b) { return _mm256_min_epi32(a, b); }
  static Whole truncated(Real a) { return _mm256_cvttps_epi32(a); }
  static Real real(Whole a) { return _mm256_cvtepi32_ps(a); }
  static int greatest(Whole a) {
    __m128i four = _mm_max_epi32(_mm256_castsi256_si128(a), _mm256_extracti128_si256(a, 1));
    four = _mm_max_epi32(four, _mm_shuffle_epi32(four, 0x4e));
    four = _mm_max_epi32(four, _mm_shuffle_epi32(four, 0xb1));
    return _mm_cvtsi128_si32(four);
  }
  static Whole column_of(Whole pixel) { return _mm256_and_si256(pixel, set(kTileSide - 1)); }
  static Whole row_of(Whole pixel) { return _mm256_srli_epi32(pixel, 5); }
  static unsigned is_less(Real a, Real b) {
    return static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LT_OQ)));
  }
  static int append(unsigned hit, Real entered, Real left, std::int32_t pixel, float* to_entered,
                    float* to_left, std::int32_t* to_pixel) {
    alignas(32) float all_entered[kWidth], all_left[kWidth];
    store(all_entered, entered);
    store(all_left, left);
    int count = 0;
    for (; hit != 0; hit &= hit - 1) {
      const int lane = __builtin_ctz(hit);
      to_entered[count] = all_entered[lane];
      to_left[count] = all_left[lane];
      to_pixel[count++] = pixel + lane;
    }
    return count;
  }
  /// Both weights of a pair, that of the next row above.
  static Whole weights(Real part) {
    const Whole next = _mm256_cvtps_epi32(_mm256_mul_ps(part, set(float(kRayWeight))));
    return _mm256_or_si256(_mm256_sub_epi32(set(kRayWeight), next), _mm256_slli_epi32(next, 16));
  }
  static Whole weighted(Whole pairs, Whole weights) { return _mm256_madd_epi16(pairs, weights); }
  static __m128 two(const std::uint32_t* quads, const std::int32_t* at) {
    const __m128i first = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(quads + at[0]));
    return _mm_loadh_pi(_mm_castsi128_ps(first), reinterpret_cast<const __m64*>(quads + at[1]));
  }
  static __m256 four(const std::uint32_t* quads, const std::int32_t* at) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(two(quads, at)), two(quads, at + 2), 1);
  }
  static void gather(const std::uint32_t* quads, Whole element, Whole& left, Whole& right) {
    // Eight loads of eight bytes are faster than the instruction that gathers, on all processors tried.
    alignas(32) std::int32_t at[kWidth];
    _mm256_store_si256(reinterpret_cast<__m256i*>(at), element);
    const __m256 low = four(quads, at), high = four(quads, at + 4);
    // Shuffles stay within halves of a register; the second step puts the quarters in order.
    left = _mm256_permute4x64_epi64(_mm256_castps_si256(_mm256_shuffle_ps(low, high, 0x88)), 0xd8);
    right = _mm256_permute4x64_epi64(_mm256_castps_si256(_mm256_shuffle_ps(low, high, 0xdd)), 0xd8);
  }
};
static_assert(kTileSide == 32, "row_of() shifts by 5");

}  // namespace

extern const ProjectCells kProjectCellsAvx2;
const ProjectCells kProjectCellsAvx2 = &project_cells<Avx2>;

}  // namespace kiroku::sim

#endif
