// The rays of a tile; see ray_march.h for what they compute. Included once by each file that compiles it.
// Everything here has internal linkage: each file has its own instructions.
//
// Lanes are sixteen samples along one ray, in the compilers' own vector types, which GCC and Clang make of
// what instructions there are. Each operation is IEEE 754's alone, none is fused or reassociated
// (-ffp-contract=off), and roots and quotients are exact: so all sets of instructions give the same bits. A
// sample passes two gates before it costs anything: its cell of the CT, or the one before or behind it on the
// ray, must show something, and where that is faint, its cross-section must be one of every second, fourth or
// eighth. What passes waits until sixteen are there.
#pragma once

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "sim/render/ray_march.h"

namespace kiroku::sim {
namespace {

constexpr int kLanes = 16;
using Real = float __attribute__((vector_size(64)));
using Whole = std::int32_t __attribute__((vector_size(64)));
using Four = float __attribute__((vector_size(16)));
using FourWhole = std::int32_t __attribute__((vector_size(16)));

constexpr float kFarMm = 1e30F;
// As preintegration.h has them.
constexpr std::size_t kNodes = 256;
constexpr float kOneOverExtinctionScale = 1.0F / 64;
// Of what cannot be seen; more bits than cross-sections have.
constexpr std::int32_t kNothing = 0x7fffffff;
// No ray meets as many cells as this but one that rounding leads in circles.
constexpr int kMostMet = 4096;

#define KIROKU_INLINE inline __attribute__((always_inline))

KIROKU_INLINE Real all(float x) { return Real{x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x}; }
KIROKU_INLINE Whole all(std::int32_t x) { return Whole{x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x}; }
KIROKU_INLINE Real counting() { return Real{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}; }
KIROKU_INLINE Whole counting_whole() { return Whole{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}; }
KIROKU_INLINE Real load(const float* from) {
  Real x;
  __builtin_memcpy(&x, from, sizeof x);
  return x;
}
KIROKU_INLINE void store(float* to, Real x) { __builtin_memcpy(to, &x, sizeof x); }
KIROKU_INLINE Real least(Real a, Real b) { return a < b ? a : b; }
KIROKU_INLINE Real most(Real a, Real b) { return a > b ? a : b; }
KIROKU_INLINE Real bits_as_real(Whole a) {
  Real x;
  __builtin_memcpy(&x, &a, sizeof x);
  return x;
}
KIROKU_INLINE Whole bits_as_whole(Real a) {
  Whole x;
  __builtin_memcpy(&x, &a, sizeof x);
  return x;
}

KIROKU_INLINE Whole truncated(Real a) { return __builtin_convertvector(a, Whole); }
KIROKU_INLINE Real real(Whole a) { return __builtin_convertvector(a, Real); }
#if defined(__AVX512F__)
// With a mask of all lanes: GCC 12 warns of its own header otherwise (GCC bug 105593).
KIROKU_INLINE Real root(Real a) { return _mm512_maskz_sqrt_ps(0xffff, a); }
#elif defined(__AVX__)
KIROKU_INLINE Real root(Real a) {
  alignas(64) float x[kLanes];
  store(x, a);
  for (int i = 0; i < kLanes; i += 8) _mm256_store_ps(x + i, _mm256_sqrt_ps(_mm256_load_ps(x + i)));
  return load(x);
}
#elif defined(__x86_64__)
KIROKU_INLINE Real root(Real a) {
  alignas(64) float x[kLanes];
  store(x, a);
  for (int i = 0; i < kLanes; i += 4) _mm_store_ps(x + i, _mm_sqrt_ps(_mm_load_ps(x + i)));
  return load(x);
}
#else
KIROKU_INLINE Real root(Real a) {
  for (int i = 0; i < kLanes; ++i) a[i] = __builtin_sqrtf(a[i]);
  return a;
}
#endif

/// 2^x, for x from -126 to 126; what is below counts as -126. Relative error below 3e-7.
KIROKU_INLINE Real power_of_two(Real x) {
  x = most(x, all(-126.0F));
  const Whole whole = truncated(x + (x < 0 ? all(-0.5F) : all(0.5F)));
  const Real f = (x - real(whole)) * 0.693147180559945F;
  // The exponential's series; f is at most 0.35.
  const Real series =
      1.0F + f * (1.0F + f * (0.5F + f * (1.0F / 6 + f * (1.0F / 24 + f * (1.0F / 120 + f * (1.0F / 720))))));
  return series * bits_as_real((whole + 127) << 23);
}
/// The logarithm to base 2 of what is greater than 0. Error below 1e-6.
KIROKU_INLINE Real logarithm(Real x) {
  // x = m 2^e with m from sqrt(1/2) to sqrt(2).
  const Whole bits = bits_as_whole(x) - 0x3f3504f3;
  const Whole exponent = bits >> 23;
  const Real m = bits_as_real((bits & 0x7fffff) + 0x3f3504f3);
  const Real s = (m - 1.0F) / (m + 1.0F), q = s * s;
  const Real series = s * (2.885390082F + q * (0.961796694F + q * (0.577078016F + q * 0.412198583F)));
  return real(exponent) + series;
}

/// Lane i has what lane i - by had; the first ones have 0.
template <int by>
KIROKU_INLINE Real moved_up(Real a) {
#if defined(__AVX512F__)
  return (Real)_mm512_maskz_alignr_epi32(0xffff, (__m512i)a, _mm512_setzero_si512(), kLanes - by);
#else
  alignas(64) float x[2 * kLanes];
  store(x, all(0.0F));
  store(x + kLanes, a);
  return load(x + kLanes - by);
#endif
}
/// Lane i has what lane i + 1 had; the last one has 0.
KIROKU_INLINE Real moved_down(Real a) {
#if defined(__AVX512F__)
  return (Real)_mm512_maskz_alignr_epi32(0xffff, _mm512_setzero_si512(), (__m512i)a, 1);
#else
  alignas(64) float x[2 * kLanes];
  store(x, a);
  store(x + kLanes, all(0.0F));
  return load(x + 1);
#endif
}
/// The sum of all lanes up to each.
KIROKU_INLINE Real sums_up_to(Real a) {
  a += moved_up<1>(a);
  a += moved_up<2>(a);
  a += moved_up<4>(a);
  a += moved_up<8>(a);
  return a;
}
KIROKU_INLINE float sum_of(Real a) { return sums_up_to(a)[kLanes - 1]; }

/// Sixteen times four numbers: the numbers of each kind together.
KIROKU_INLINE void transpose(const float* from, Real to[4]) {
#if defined(__AVX512F__)
  const __m512 a = load(from), b = load(from + 16), c = load(from + 32), d = load(from + 48);
  // From each pair of four samples: kinds 0 and 1, kinds 2 and 3.
  const __m512i low = _mm512_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28, 1, 5, 9, 13, 17, 21, 25, 29);
  const __m512i high = _mm512_setr_epi32(2, 6, 10, 14, 18, 22, 26, 30, 3, 7, 11, 15, 19, 23, 27, 31);
  const __m512 ab01 = _mm512_permutex2var_ps(a, low, b), cd01 = _mm512_permutex2var_ps(c, low, d);
  const __m512 ab23 = _mm512_permutex2var_ps(a, high, b), cd23 = _mm512_permutex2var_ps(c, high, d);
  to[0] = _mm512_maskz_shuffle_f32x4(0xffff, ab01, cd01, 0x44);
  to[1] = _mm512_maskz_shuffle_f32x4(0xffff, ab01, cd01, 0xee);
  to[2] = _mm512_maskz_shuffle_f32x4(0xffff, ab23, cd23, 0x44);
  to[3] = _mm512_maskz_shuffle_f32x4(0xffff, ab23, cd23, 0xee);
#else
  alignas(64) float kinds[4][kLanes];
#if defined(__x86_64__)
  for (int at = 0; at < kLanes; at += 4) {
    __m128 a = _mm_loadu_ps(from + 4 * at), b = _mm_loadu_ps(from + 4 * at + 4),
           c = _mm_loadu_ps(from + 4 * at + 8), d = _mm_loadu_ps(from + 4 * at + 12);
    _MM_TRANSPOSE4_PS(a, b, c, d);
    _mm_store_ps(kinds[0] + at, a);
    _mm_store_ps(kinds[1] + at, b);
    _mm_store_ps(kinds[2] + at, c);
    _mm_store_ps(kinds[3] + at, d);
  }
#else
  for (int i = 0; i < 4 * kLanes; ++i) kinds[i % 4][i / 4] = from[i];
#endif
  for (int kind = 0; kind < 4; ++kind) to[kind] = load(kinds[kind]);
#endif
}

/// The eight numbers of two texels beside each other.
#if defined(__AVX2__)
using Eight = __m256;
KIROKU_INLINE Eight two_texels(const std::uint16_t* at) {
  return _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(at))));
}
KIROKU_INLINE Four low_half(Eight a) { return _mm256_castps256_ps128(a); }
KIROKU_INLINE Four high_half(Eight a) { return _mm256_extractf128_ps(a, 1); }
KIROKU_INLINE Eight scaled(Eight a, float by) { return _mm256_mul_ps(a, _mm256_set1_ps(by)); }
KIROKU_INLINE Eight sum(Eight a, Eight b) { return _mm256_add_ps(a, b); }
#else
struct Eight {
  Four low, high;
};
KIROKU_INLINE Eight two_texels(const std::uint16_t* at) {
  return {Four{float(at[0]), float(at[1]), float(at[2]), float(at[3])},
          Four{float(at[4]), float(at[5]), float(at[6]), float(at[7])}};
}
KIROKU_INLINE Four low_half(const Eight& a) { return a.low; }
KIROKU_INLINE Four high_half(const Eight& a) { return a.high; }
KIROKU_INLINE Eight scaled(const Eight& a, float by) { return {a.low * by, a.high * by}; }
KIROKU_INLINE Eight sum(const Eight& a, const Eight& b) { return {a.low + b.low, a.high + b.high}; }
#endif

/// Four numbers of 16 bits, none of them subnormal.
KIROKU_INLINE Four halves(const std::uint16_t* at) {
  using FourHalves = std::uint16_t __attribute__((vector_size(8)));
  FourHalves bits;
  __builtin_memcpy(&bits, at, sizeof bits);
  const FourWhole moved = __builtin_convertvector(bits, FourWhole) << 13;
  Four x;
  __builtin_memcpy(&x, &moved, sizeof x);
  return x * 0x1p112F;
}

/// A bit for each lane whose number is not 0.
KIROKU_INLINE unsigned lanes_of(Whole a) {
#if defined(__AVX512F__)
  return _mm512_test_epi32_mask((__m512i)a, (__m512i)a);
#elif defined(__AVX2__)
  alignas(64) std::int32_t x[kLanes];
  __builtin_memcpy(x, &a, sizeof x);
  // Comparisons have set all bits of a lane, or none.
  const auto half = [&](int at) {
    return unsigned(
        _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_load_si256(reinterpret_cast<const __m256i*>(x + at)))));
  };
  return half(0) | half(8) << 8U;
#else
  unsigned lanes = 0;
  for (unsigned lane = 0; lane < kLanes; ++lane) lanes |= (a[lane] != 0 ? 1U : 0U) << lane;
  return lanes;
#endif
}

/// The bytes at the indices of the first `count` lanes; the others are 0. A cell has few cross-sections, and
/// processors that had to be mended are slow to gather.
KIROKU_INLINE Whole bytes_at(const std::uint8_t* bytes, Whole index, int count) {
  alignas(64) std::int32_t at[kLanes];
  alignas(64) std::int32_t found[kLanes] = {};
  __builtin_memcpy(at, &index, sizeof at);
  for (int i = 0; i < kLanes && i < count; ++i) found[i] = bytes[at[i]];
  Whole x;
  __builtin_memcpy(&x, found, sizeof x);
  return x;
}

/// The lanes of `a` that are in `lanes`, one after the other.
KIROKU_INLINE void append(float* to, Real a, unsigned lanes) {
#if defined(__AVX512F__)
  store(to, _mm512_maskz_compress_ps(static_cast<__mmask16>(lanes), a));
#else
  alignas(64) float x[kLanes];
  store(x, a);
  for (; lanes != 0; lanes &= lanes - 1) *to++ = x[__builtin_ctz(lanes)];
#endif
}

/// Towards positive infinity; for what is within ±1e9.
KIROKU_INLINE float ceiling(float x) {
  const auto whole = float(std::int32_t(x));
  return whole < x ? whole + 1 : whole;
}
/// The first cross-section at or beyond a depth.
KIROKU_INLINE float section_from(float depth_mm, float per_mm) {
  const float section = depth_mm * per_mm;
  return section > 1e9F ? 1e9F : section > 0 ? ceiling(section) : 0;
}
/// The first one beyond a depth that is not negative.
KIROKU_INLINE float section_beyond(float depth_mm, float per_mm) {
  const float section = depth_mm * per_mm;
  return section < 1e9F ? float(std::int32_t(section)) + 1 : 1e9F;
}

KIROKU_INLINE Four four(const float* from) {
  Four x;
  __builtin_memcpy(&x, from, sizeof x);
  return x;
}
KIROKU_INLINE float dot(const float* a, float x, float y, float z) { return a[0] * x + a[1] * y + a[2] * z; }

/// Samples that wait to be shaded.
struct Waiting {
  static constexpr int kRoom = 3 * kLanes;
  alignas(64) float place[3][kRoom] = {};
  alignas(64) float turn[4][kRoom] = {};
  alignas(64) float linked[kRoom] = {};  // 1: a segment ends here; 0: one begins
  alignas(64) float tint[kRoom] = {};
  alignas(64) float depth_mm[kRoom] = {};  // along the view
  // Of those that are being shaded: the segments' lengths, the CT's texels, and what is seen of the segments.
  alignas(64) float length_mm[kLanes] = {};
  alignas(64) float texels[4 * kLanes] = {};
  alignas(64) float tissues[4 * kLanes] = {};
  int count = 0;

  void keep_from(int first) {
    const auto move = [&](float* numbers) { store(numbers, load(numbers + first)); };
    for (auto& numbers : place) move(numbers);
    for (auto& numbers : turn) move(numbers);
    move(linked);
    move(tint);
    move(depth_mm);
    count = count > first ? count - first : 0;
  }
};

class Ray {
 public:
  /// `slope`: of a ray that a lens bends, else null.
  Ray(const MarchScene& scene, Waiting& waiting, int x, int y, const float* slope)
      : scene_(scene), waiting_(waiting) {
    const float s = (float(x) + 0.5F) * scene.one_over_size[0] * 2 - 1;
    const float t = (float(scene.height - 1 - y) + 0.5F) * scene.one_over_size[1] * 2 - 1;
    const float u = s * scene.half_extent[0] + scene.centre[0];
    const float v = t * scene.half_extent[1] + scene.centre[1];
    if (slope != nullptr) {
      along_[0] = slope[0];
      along_[1] = slope[1];
    } else if (scene.parallel != 0) {
      origin_[0] = u;
      origin_[1] = v;
    } else {
      along_[0] = u;
      along_[1] = v;
    }
    length_ = __builtin_sqrtf(along_[0] * along_[0] + along_[1] * along_[1] + 1);
    per_mm_ = 1 / scene.spacing_mm;
    for (int c = 0; c < 3; ++c) to_eye_[c] = (c < 2 ? -along_[c] : 1.0F) / length_;
    // Half way between the light and the eye.
    float sum = 0;
    for (int c = 0; c < 3; ++c) {
      between_[c] = scene.light[c] + to_eye_[c];
      sum += between_[c] * between_[c];
    }
    for (float& c : between_) c /= __builtin_sqrtf(sum);
    for (Real& colour : sums_) colour = all(0.0F);
  }

  void follow(const std::uint32_t* entries, int layers, float end_mm, float* colour) {
    waiting_.count = 0;
    for (int layer = 0; layer < layers && through_ > scene_.ended_share; ++layer) {
      if (!follow_layer(entries[layer], end_mm)) break;
    }
    if (through_ > scene_.ended_share && waiting_.count > 0) shade();
    // What a ray that ended early would have met counts as what it has met.
    if (through_ <= scene_.ended_share) {
      const float more = 1 / (1 - through_);
      for (Real& sum : sums_) sum *= more;
      for (float& sum : sheet_sum_) sum *= more;
      through_ = 0;
    }
    if (scene_.tip != 0) return follow_in_light(colour);
    for (int c = 0; c < 3; ++c) colour[c] = sum_of(sums_[c]) + sheet_sum_[c] + through_ * colour[c];
  }

 private:
  /// From where a ray enters the mesh to where it leaves it. Whether it goes on.
  bool follow_layer(std::uint32_t entry, float end_mm) {
    std::uint32_t number = entry >> 2U;
    std::uint32_t from = entry & 3U;
    bool entering = true;
    bool begins = true;  // the layer's first sample is still to come
    float next = 0;      // the cross-section that comes next
    last_mask_ = 0;
    last_kept_ = true;
    for (int met = 0; met < kMostMet; ++met) {
      const MarchCell& cell = scene_.cells[number];
      const Four begin = begin_of(cell.corner), slope = slope_of(cell.corner);
      const Four crossing = -begin / slope;
      const FourWhole is_from = FourWhole{0, 1, 2, 3} == std::int32_t(from);
      const Four leaving = ((slope < 0) & ~is_from) ? crossing : Four{kFarMm, kFarMm, kFarMm, kFarMm};
      const float out01 = leaving[0] < leaving[1] ? leaving[0] : leaving[1];
      const float out23 = leaving[2] < leaving[3] ? leaving[2] : leaving[3];
      const float out_at = out01 < out23 ? out01 : out23;
      if (!(out_at < kFarMm)) return true;  // a cell without volume
      const int out01_corner = leaving[0] < leaving[1] ? 0 : 1,
                out23_corner = leaving[2] < leaving[3] ? 2 : 3;
      const int exit = out01 < out23 ? out01_corner : out23_corner;
      if (entering) {
        entering = false;
        const float in_at = crossing[from];
        reached_ = reached_ > in_at ? reached_ : in_at;
        next = section_beyond(reached_, per_mm_);
        if (scene_.sheeted != 0 && in_at < end_mm) pass_sheet(cell, int(from), true, in_at);
      }
      const float stop = out_at < end_mm ? out_at : end_mm;
      const std::uint32_t into = cell.beyond[exit];
      const bool closes = into == kMarchNone || out_at >= end_mm;
      if (begins && reached_ < stop) {
        begins = false;
        take(cell, reached_, 0);
      }
      const float beyond = section_from(stop, per_mm_);
      if (!begins && beyond > next) {
        if (cell.hidden != 0) {
          pass_hidden(cell, next, beyond);
        } else {
          gather(cell, std::int32_t(next), std::int32_t(beyond));
        }
        next = beyond;
      }
      if (!begins && closes && through_ > scene_.ended_share) {
        take(cell, stop, last_mask_ == kNothing ? 0 : 1);
        reached_ = stop;
      }
      if (out_at >= end_mm || through_ <= scene_.ended_share) return false;
      if (into == kMarchNone) {
        if (scene_.sheeted != 0) pass_sheet(cell, exit, false, out_at);
        return true;
      }
      number = into >> 2U;
      from = into & 3U;
    }
    return true;
  }

  KIROKU_INLINE Four begin_of(const float (&of)[4][4]) const {
    return four(of[0]) * origin_[0] + four(of[1]) * origin_[1] + four(of[3]);
  }
  KIROKU_INLINE Four slope_of(const float (&of)[4][4]) const {
    return four(of[0]) * along_[0] + four(of[1]) * along_[1] - four(of[2]);
  }

  /// A sample of its own.
  void take(const MarchCell& cell, float depth_mm, float linked) {
    const Four place = begin_of(cell.voxel) + slope_of(cell.voxel) * depth_mm;
    const Four turn = begin_of(cell.turn) + slope_of(cell.turn) * depth_mm;
    const int at = waiting_.count++;
    for (int axis = 0; axis < 3; ++axis) {
      const float last_texel = float(scene_.volume.size[axis]) - 1.001F;
      const float from_first = place[axis] > 0 ? place[axis] : 0;
      waiting_.place[axis][at] = from_first < last_texel ? from_first : last_texel;
    }
    for (int c = 0; c < 4; ++c) waiting_.turn[c][at] = turn[c];
    waiting_.linked[at] = linked;
    waiting_.depth_mm[at] = depth_mm;
    if (scene_.tinted != 0) waiting_.tint[at] = tint_at(cell) + depth_mm * tint_slope(cell);
    if (waiting_.count >= kLanes) shade();
  }

  /// Of a cell in which nothing can be seen: the sample that a segment before it ends at.
  void pass_hidden(const MarchCell& cell, float first, float last) {
    const bool ends = last_mask_ != kNothing;
    if (ends) take(cell, first * scene_.spacing_mm, 1);
    last_kept_ = ends && last - first < 1.5F;
    last_mask_ = kNothing;
  }

  /// The sample before a cross-section that has `mask`, where a segment must begin there and it was left out.
  KIROKU_INLINE void take_before(const MarchCell& cell, std::int32_t section, std::int32_t mask) {
    const bool comes_into_view = last_mask_ == kNothing && mask != kNothing;
    if (last_kept_ || !(comes_into_view || mask == 0)) return;
    take(cell, float(section - 1) * scene_.spacing_mm, comes_into_view ? 0 : 1);
  }

  KIROKU_INLINE float tint_at(const MarchCell& cell) const {
    return cell.tint[0] * origin_[0] + cell.tint[1] * origin_[1] + cell.tint[3];
  }
  KIROKU_INLINE float tint_slope(const MarchCell& cell) const {
    return cell.tint[0] * along_[0] + cell.tint[1] * along_[1] - cell.tint[2];
  }

  /// Of cross-sections where cells of the CT are so opaque: 0 for each, and 1, 3 or 7 for every second,
  /// fourth or eighth, which has none of these bits; kNothing where nothing can be seen.
  KIROKU_INLINE Whole masks_of(Whole opacity) const {
    return (opacity <= scene_.sparse[0] ? all(1) : all(0)) | (opacity <= scene_.sparse[1] ? all(3) : all(0)) |
           (opacity <= scene_.sparse[2] ? all(7) : all(0)) | (opacity <= 0 ? all(kNothing) : all(0));
  }

  /// The samples of a cell on the cross-sections [first, last).
  void gather(const MarchCell& cell, std::int32_t first, std::int32_t last) {
    const Four place = begin_of(cell.voxel), step = slope_of(cell.voxel);
    const Four turn = begin_of(cell.turn), turning = slope_of(cell.turn);
    const float tint = tint_at(cell), tinting = tint_slope(cell);
    const MarchVolume& volume = scene_.volume;
    // In most cells that are seen at all, everything is.
    const bool dense = std::int32_t(cell.least_opacity) > scene_.sparse[0];
    for (std::int32_t section = first; section < last; section += kLanes) {
      const int left = last - section;
      const Whole sections = all(section) + counting_whole();
      const Real t = real(sections) * scene_.spacing_mm;
      Real at[3];
      Whole index = all(0);
      for (int axis = 2; axis >= 0; --axis) {
        at[axis] = place[axis] + t * step[axis];
        // The bound comes second: it is also what becomes of a number that is none.
        const Real last_texel = all(float(volume.size[axis]) - 1.001F);
        at[axis] = least(most(at[axis], all(0.0F)), last_texel);
        if (!dense) index = index * volume.blocks[axis] + (truncated(at[axis]) >> 1);
      }
      unsigned lanes = left < kLanes ? (1U << unsigned(left)) - 1U : 0xffffU;
      Real linked = all(1.0F);
      if (!dense) {
        const int last_lane = left < kLanes ? left - 1 : kLanes - 1;
        Whole mask = masks_of(bytes_at(volume.opacity, index, left));
        take_before(cell, section, mask[0]);
        if (through_ <= scene_.ended_share) return;
        Whole before = bits_as_whole(moved_up<1>(bits_as_real(mask)));
        before[0] = last_mask_;
        // What is behind the last one is not known yet.
        Whole behind = bits_as_whole(moved_down(bits_as_real(mask)));
        behind[last_lane] = kNothing;
        const Whole is_nothing = mask == kNothing, was_nothing = before == kNothing;
        // Where a segment that can be seen begins or ends.
        const Whole is_border = is_nothing & ~(was_nothing & (behind == kNothing));
        lanes &= lanes_of(is_border | ((sections & mask & before & behind) == 0));
        linked = (is_nothing & was_nothing) != 0 ? all(0.0F) : all(1.0F);
        last_mask_ = mask[last_lane];
        last_kept_ = (lanes >> unsigned(last_lane) & 1U) != 0;
        if (lanes == 0) continue;
      } else {
        take_before(cell, section, 0);
        if (through_ <= scene_.ended_share) return;
        last_mask_ = 0;
        last_kept_ = true;
      }
      const int count = waiting_.count;
      for (int axis = 0; axis < 3; ++axis) append(waiting_.place[axis] + count, at[axis], lanes);
      for (int c = 0; c < 4; ++c) append(waiting_.turn[c] + count, turn[c] + t * turning[c], lanes);
      append(waiting_.linked + count, linked, lanes);
      append(waiting_.depth_mm + count, t, lanes);
      if (scene_.tinted != 0) append(waiting_.tint + count, tint + t * tinting, lanes);
      waiting_.count += __builtin_popcount(lanes);
      if (waiting_.count < kLanes) continue;
      shade();
      if (through_ <= scene_.ended_share) return;
    }
  }

  /// The first sixteen that wait, or all.
  void shade() {
    int count = waiting_.count < kLanes ? waiting_.count : kLanes;
    const MarchVolume& volume = scene_.volume;
    alignas(64) float weights[4][kLanes], across[kLanes];
    alignas(64) std::int32_t indices[kLanes];
    Real part[3];
    Whole index = all(0);
    for (int axis = 2; axis >= 0; --axis) {
      const Real at = load(waiting_.place[axis]);
      const Whole whole = truncated(at);
      part[axis] = at - real(whole);
      index = index * volume.size[axis] + whole;
    }
    const Real less[3] = {1.0F - part[0], 1.0F - part[1], 1.0F - part[2]};
    store(weights[0], less[1] * less[2]);
    store(weights[1], part[1] * less[2]);
    store(weights[2], less[1] * part[2]);
    store(weights[3], part[1] * part[2]);
    store(across, part[0]);
    __builtin_memcpy(indices, &index, sizeof indices);
    const Real depth = load(waiting_.depth_mm);
    Real front = moved_up<1>(depth);
    front[0] = last_depth_mm_;
    store(waiting_.length_mm, most(depth - front, all(0.0F)) * (length_ * load(waiting_.linked)));
    float* const texels = waiting_.texels;
    float* const tissues = waiting_.tissues;
    const std::size_t row = 4 * std::size_t(volume.size[0]), plane = row * std::size_t(volume.size[1]);
    std::size_t last_node = last_node_;
    float spent = spent_;
    for (int i = 0; i < count; ++i) {
      const std::uint16_t* const texel = volume.texels + 4 * std::size_t(indices[i]);
      const Eight mean =
          sum(sum(scaled(two_texels(texel), weights[0][i]), scaled(two_texels(texel + row), weights[1][i])),
              sum(scaled(two_texels(texel + plane), weights[2][i]),
                  scaled(two_texels(texel + row + plane), weights[3][i])));
      const Four low = low_half(mean), found = low + (high_half(mean) - low) * across[i];
      __builtin_memcpy(texels + 4 * i, &found, sizeof found);
      const std::size_t node = volume.node_of[std::int32_t(found[3] * (4095.0F / 65535) + 0.5F)];
      const Four tissue = halves(volume.segments + 4 * (kNodes * last_node + node));
      last_node = node;
      __builtin_memcpy(tissues + 4 * i, &tissue, sizeof tissue);
      spent += tissue[3] * kOneOverExtinctionScale * waiting_.length_mm[i];
      // The ray ends within these sixteen.
      if (spent > scene_.ended_extinction) count = i + 1;
    }
    last_node_ = last_node;
    spent_ = spent;
    Real texel[4], tissue[4];
    transpose(texels, texel);
    transpose(tissues, tissue);
    if (scene_.tinted != 0) tint(tissue);
    Real gradient[3];
    for (int c = 0; c < 3; ++c) {
      Real before = moved_up<1>(texel[c]);
      before[0] = last_texel_[c];
      gradient[c] = (texel[c] + before) * (0.5F * scene_.gradient_scale) - scene_.gradient_zero;
    }
    add(gradient, (depth + front) * 0.5F, tissue, count);
    // Both say it, or a ray goes on whose samples were left out: the two are rounded otherwise.
    if (spent_ > scene_.ended_extinction)
      through_ = through_ < scene_.ended_share ? through_ : scene_.ended_share;
    for (int c = 0; c < 3; ++c) last_texel_[c] = texel[c][count - 1];
    last_depth_mm_ = depth[count - 1];
    waiting_.keep_from(count);
  }

  /// Colours go towards that of the tint.
  void tint(Real tissue[4]) const {
    alignas(64) float colours[4 * kLanes];
    const Real number = least(most(load(waiting_.tint), all(0.0F)), all(1.0F));
    const Whole entries = truncated(number * 255.0F + 0.5F);
    for (int i = 0; i < kLanes; ++i)
      __builtin_memcpy(colours + 4 * i, scene_.tint_colours + 4 * entries[i], 4 * sizeof(float));
    Real painted[4];
    transpose(colours, painted);
    for (int c = 0; c < 3; ++c)
      tissue[c] = tissue[c] * (1 - scene_.tint_share) + painted[c] * scene_.tint_share;
  }

  /// Lights the first `count` segments, whose middles are so deep, and blends them over what is behind.
  void add(const Real g[3], Real depth_mm, const Real tissue[4], int count) {
    const Real steep = root(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
    const Real shaded = least(most((steep - scene_.edge_from) * scene_.edge_scale, all(0.0F)), all(1.0F));
    const Real q0 = load(waiting_.turn[0]), q1 = load(waiting_.turn[1]), q2 = load(waiting_.turn[2]),
               q3 = load(waiting_.turn[3]);
    // v + 2 q x (q x v + w v) / |q|^2 over its length, towards where there is less: air, fat, outside.
    const Real a0 = q1 * g[2] - q2 * g[1] + q3 * g[0], a1 = q2 * g[0] - q0 * g[2] + q3 * g[1],
               a2 = q0 * g[1] - q1 * g[0] + q3 * g[2];
    const Real square = most(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3, all(1e-20F));
    const Real length = most(steep, all(1e-6F)), one_over = 1.0F / (square * length);
    const Real twice = 2.0F * length * one_over, down = -square * one_over;
    const Real n0 = (g[0] + twice * (q1 * a2 - q2 * a1)) * down,
               n1 = (g[1] + twice * (q2 * a0 - q0 * a2)) * down,
               n2 = (g[2] + twice * (q0 * a1 - q1 * a0)) * down;
    const Real n[3] = {n0, n1, n2};
    Real lit, shine;
    if (scene_.tip != 0) {
      light_by_tip(n, shaded, depth_mm, lit, shine);
    } else {
      const Real falling =
          most(n0 * scene_.light[0] + n1 * scene_.light[1] + n2 * scene_.light[2], all(0.0F));
      const Real diffuse = 0.75F + shaded * (falling - 0.75F);
      const Real half = most(n0 * between_[0] + n1 * between_[1] + n2 * between_[2], all(1e-6F));
      const Real gloss = power_of_two(scene_.shininess * logarithm(half));
      lit = scene_.ambient + scene_.diffuse * diffuse;
      shine = scene_.specular * shaded * gloss;
    }
    Real taken = tissue[3] * kOneOverExtinctionScale * load(waiting_.length_mm);
    taken = real(counting_whole()) < float(count) ? taken : all(0.0F);
    const Real after = through_ * power_of_two(-sums_up_to(taken));
    Real before = moved_up<1>(after);
    before[0] = through_;
    const Real weight = before - after;
    for (int c = 0; c < 3; ++c) sums_[c] += weight * (tissue[c] * lit + shine);
    through_ = after[kLanes - 1];
  }

  /// As tip_lighting.h has it: what a colour is multiplied by, and what the film of water adds.
  void light_by_tip(const Real n[3], Real shaded, Real depth, Real& lit, Real& shine) const {
    Real l[3], h[3];
    for (int c = 0; c < 2; ++c) l[c] = scene_.light[c] - (origin_[c] + depth * along_[c]);
    l[2] = scene_.light[2] + depth;
    const Real square = most(l[0] * l[0] + l[1] * l[1] + l[2] * l[2], all(1e-6F));
    const Real bright = scene_.tip_power / square, one_over = 1.0F / root(square);
    for (Real& c : l) c *= one_over;
    for (int c = 0; c < 3; ++c) h[c] = l[c] + to_eye_[c];
    const Real half = 1.0F / root(most(h[0] * h[0] + h[1] * h[1] + h[2] * h[2], all(1e-6F)));
    for (Real& c : h) c *= half;
    const Real falling = most(n[0] * l[0] + n[1] * l[1] + n[2] * l[2], all(0.0F));
    const Real at_half = most(n[0] * h[0] + n[1] * h[1] + n[2] * h[2], all(0.0F));
    const Real light_at_half = most(l[0] * h[0] + l[1] * h[1] + l[2] * h[2], all(1e-3F));
    const Real spread = 1.0F + at_half * at_half * (scene_.film_spread - 1.0F);
    const Real off = most(1.0F - light_at_half, all(0.0F)), off2 = off * off;
    const Real fresnel = scene_.film_reflectance + (1 - scene_.film_reflectance) * (off2 * off2 * off);
    const Real film =
        scene_.film_spread * fresnel * falling / (4.0F * light_at_half * light_at_half * spread * spread);
    lit = bright * (scene_.ambient + scene_.diffuse * (0.75F + shaded * (falling - 0.75F)));
    shine = bright * scene_.wet * shaded * film;
  }

  /// What is behind a ray that gathered light, and both as a picture has them.
  void follow_in_light(float* colour) const {
    Real shown = all(0.0F);
    for (int c = 0; c < 3; ++c) shown[c] = colour[c];
    shown = power_of_two(scene_.gamma * logarithm(most(shown, all(1e-6F))));
    for (int c = 0; c < 3; ++c) shown[c] = sum_of(sums_[c]) + sheet_sum_[c] + through_ * shown[c];
    shown = power_of_two(scene_.one_over_gamma * logarithm(least(most(shown, all(1e-6F)), all(1.0F))));
    for (int c = 0; c < 3; ++c) colour[c] = shown[c];
  }

  /// A face of the surface, lit from outside.
  void pass_sheet(const MarchCell& cell, int corner, bool entering, float depth_mm) {
    while (waiting_.count > 0) shade();
    // Within the cell the barycentric coordinate of the corner opposite grows.
    float n[3], sum = 0;
    for (int axis = 0; axis < 3; ++axis) {
      n[axis] = entering ? -cell.corner[axis][corner] : cell.corner[axis][corner];
      sum += n[axis] * n[axis];
    }
    if (!(sum > 0)) return;
    for (float& c : n) c /= __builtin_sqrtf(sum);
    float to_light[3] = {scene_.light[0], scene_.light[1], scene_.light[2]};
    float between[3] = {between_[0], between_[1], between_[2]};
    float bright = 1;
    if (scene_.tip != 0) {
      for (int c = 0; c < 3; ++c) to_light[c] -= c < 2 ? origin_[c] + depth_mm * along_[c] : -depth_mm;
      const float square = dot(to_light, to_light[0], to_light[1], to_light[2]);
      for (float& c : to_light) c /= __builtin_sqrtf(square);
      bright = scene_.tip_power / square;
      for (int c = 0; c < 3; ++c) between[c] = to_light[c] + to_eye_[c];
      const float length = __builtin_sqrtf(dot(between, between[0], between[1], between[2]));
      for (float& c : between) c /= length;
    }
    const float falling = dot(to_light, n[0], n[1], n[2]);
    const float light = 0.35F + 0.65F * (falling > 0 ? falling : 0);
    float gloss = 0;
    if (entering) {
      const float half = dot(between, n[0], n[1], n[2]);
      const float to_2 = half > 0 ? half * half : 0, to_4 = to_2 * to_2, to_8 = to_4 * to_4,
                  to_16 = to_8 * to_8;
      gloss = 0.3F * (to_16 * to_16 * to_8);
    }
    for (int c = 0; c < 3; ++c)
      sheet_sum_[c] += through_ * scene_.sheet[3] * (bright * (scene_.sheet[c] * light + gloss));
    through_ *= 1 - scene_.sheet[3];
  }

  const MarchScene& scene_;
  Waiting& waiting_;
  float origin_[2] = {0, 0}, along_[2] = {0, 0};
  float length_ = 1, per_mm_ = 0;
  float to_eye_[3], between_[3];
  Real sums_[3];
  float sheet_sum_[3] = {0, 0, 0};
  float through_ = 1;
  float spent_ = 0;    // extinction up to here
  float reached_ = 0;  // depth up to which was gathered
  // Of the cross-section before.
  std::int32_t last_mask_ = 0;
  bool last_kept_ = true;
  // Of the sample that was shaded last.
  float last_texel_[3] = {0, 0, 0};
  float last_depth_mm_ = 0;
  std::size_t last_node_ = 0;
};

/// The pixels of a tile. Every stride-th pixel of every stride-th row is cast first, and the last of both.
/// What is half way between pixels that are alike is between them in colour too, the rest is cast; so again
/// with half the stride, until each pixel is there.
class Tile {
 public:
  Tile(const MarchScene& scene, const MarchTile& tile)
      : scene_(scene), tile_(tile), width_(tile.x1 - tile.x0), height_(tile.y1 - tile.y0) {}

  void draw() {
    bool any = false;
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) any |= tile_.layers[number(x, y)] != 0;
    }
    if (!any) return;
    const int first = scene_.likeness > 0 ? scene_.stride : 1;
    for (int y = 0; y < height_; y = next(y, first, height_)) {
      for (int x = 0; x < width_; x = next(x, first, width_)) cast(x, y);
    }
    for (int apart = first; apart > 1; apart /= 2) {
      for (int y = 0; y < height_; y = next(y, apart / 2, height_)) {
        for (int x = 0; x < width_; x = next(x, apart / 2, width_)) {
          if (!(is_on(x, apart, width_) && is_on(y, apart, height_)) && !interpolate(x, y, apart)) cast(x, y);
        }
      }
    }
  }

 private:
  // `apart` is a power of two.
  static bool is_on(int at, int apart, int size) { return (at & (apart - 1)) == 0 || at == size - 1; }
  static int next(int at, int apart, int size) {
    const int after = (at & -apart) + apart;
    return after < size || at == size - 1 ? after : size - 1;
  }
  static int number(int x, int y) { return y * kMarchTile + x; }

  void cast(int x, int y) {
    const int pixel = number(x, y);
    const int layers = tile_.layers[pixel];
    if (layers == 0) return;
    const float* const slope = tile_.slopes == nullptr ? nullptr : tile_.slopes + 2 * pixel;
    Ray ray(scene_, waiting_, tile_.x0 + x, tile_.y0 + y, slope);
    ray.follow(tile_.entries + pixel * kMarchLayers, layers, tile_.end_mm[pixel], tile_.colour + 3 * pixel);
  }

  /// What lies around, of pixels so far apart, and its share in what is between.
  struct Neighbours {
    int from, to;
    float share;  // of the second
  };
  static Neighbours around(int at, int apart, int size) {
    if (is_on(at, apart, size)) return {at, at, 0};
    const int from = at & -apart, to = next(from, apart, size);
    return {from, to, float(at - from) / float(to - from)};
  }

  bool interpolate(int x, int y, int apart) {
    const Neighbours across = around(x, apart, width_), down = around(y, apart, height_);
    const int pixel = number(x, y);
    if (tile_.layers[pixel] == 0 || tile_.end_mm[pixel] < kFarMm) return false;
    const int corners[4] = {number(across.from, down.from), number(across.to, down.from),
                            number(across.from, down.to), number(across.to, down.to)};
    const float shares[4] = {(1 - across.share) * (1 - down.share), across.share * (1 - down.share),
                             (1 - across.share) * down.share, across.share * down.share};
    float least[3], most[3], sum[3] = {0, 0, 0};
    for (int c = 0; c < 3; ++c) least[c] = most[c] = tile_.colour[3 * corners[0] + c];
    for (int corner = 0; corner < 4; ++corner) {
      const int other = corners[corner];
      // Where the body ends or a tool is, nothing is between.
      if (tile_.layers[other] != tile_.layers[pixel] || tile_.end_mm[other] < kFarMm) return false;
      for (int c = 0; c < 3; ++c) {
        const float colour = tile_.colour[3 * other + c];
        sum[c] += shares[corner] * colour;
        least[c] = colour < least[c] ? colour : least[c];
        most[c] = colour > most[c] ? colour : most[c];
      }
    }
    for (int c = 0; c < 3; ++c) {
      if (most[c] - least[c] > scene_.likeness) return false;
    }
    for (int c = 0; c < 3; ++c) tile_.colour[3 * pixel + c] = sum[c];
    return true;
  }

  const MarchScene& scene_;
  const MarchTile& tile_;
  int width_, height_;
  Waiting waiting_;
};

void march_tile(const MarchScene& scene, const MarchTile& tile) { Tile(scene, tile).draw(); }

#undef KIROKU_INLINE

}  // namespace
}  // namespace kiroku::sim
