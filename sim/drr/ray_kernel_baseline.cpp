// Four lanes of whatever the compiler is told to build for, in the compilers' own vector types.
#include "sim/drr/ray_kernel_lanes.h"

namespace kiroku::sim {
namespace {

struct Baseline {
  static constexpr int kWidth = 4;
  using Real = float __attribute__((vector_size(16)));
  using Whole = std::int32_t __attribute__((vector_size(16)));

  static Real set(float x) { return Real{x, x, x, x}; }
  static Whole set(std::int32_t x) { return Whole{x, x, x, x}; }
  static Real counting() { return Real{0, 1, 2, 3}; }
  static Real load(const float* from) { return Real{from[0], from[1], from[2], from[3]}; }
  static Whole load(const std::int32_t* from) { return Whole{from[0], from[1], from[2], from[3]}; }
  static void store(float* to, Real x) {
    for (int lane = 0; lane < kWidth; ++lane) to[lane] = x[lane];
  }
  static Real add(Real a, Real b) { return a + b; }
  static Real subtract(Real a, Real b) { return a - b; }
  static Real multiply(Real a, Real b) { return a * b; }
  static Real divide(Real a, Real b) { return a / b; }
  static Real fma(Real a, Real b, Real c) { return a * b + c; }
  static Real min(Real a, Real b) { return a < b ? a : b; }
  static Real max(Real a, Real b) { return a > b ? a : b; }
  static Real magnitude(Real a) { return a < 0 ? -a : a; }
  static Real not_near_zero(Real a) { return magnitude(a) >= set(1e-6F) ? a : set(1e-6F); }
  static Whole add(Whole a, Whole b) { return a + b; }
  static Whole subtract(Whole a, Whole b) { return a - b; }
  static Whole multiply(Whole a, Whole b) { return a * b; }
  static Whole min(Whole a, Whole b) { return a < b ? a : b; }
  static Whole truncated(Real a) { return __builtin_convertvector(a, Whole); }
  static Real real(Whole a) { return __builtin_convertvector(a, Real); }
  static int greatest(Whole a) {
    int most = a[0];
    for (int lane = 1; lane < kWidth; ++lane) most = a[lane] > most ? a[lane] : most;
    return most;
  }
  static Whole column_of(Whole pixel) { return pixel & (kTileSide - 1); }
  static Whole row_of(Whole pixel) { return pixel / kTileSide; }
  static unsigned is_less(Real a, Real b) {
    unsigned mask = 0;
    for (unsigned lane = 0; lane < kWidth; ++lane) mask |= (a[lane] < b[lane] ? 1U : 0U) << lane;
    return mask;
  }
  static int append(unsigned hit, Real entered, Real left, std::int32_t pixel, float* to_entered,
                    float* to_left, std::int32_t* to_pixel) {
    int count = 0;
    for (int lane = 0; lane < kWidth; ++lane) {
      if ((hit >> unsigned(lane) & 1U) == 0) continue;
      to_entered[count] = entered[lane];
      to_left[count] = left[lane];
      to_pixel[count++] = pixel + lane;
    }
    return count;
  }
  /// That of the next row.
  static Whole weights(Real part) { return truncated(part * float(kRayWeight) + 0.5F); }
  static Whole weighted(Whole pairs, Whole weights) {
    return (pairs & 0x7fff) * (kRayWeight - weights) + (pairs >> 16) * weights;
  }
  static void gather(const std::uint32_t* quads, Whole element, Whole& left, Whole& right) {
    for (int lane = 0; lane < kWidth; ++lane) {
      left[lane] = static_cast<std::int32_t>(quads[element[lane]]);
      right[lane] = static_cast<std::int32_t>(quads[element[lane] + 1]);
    }
  }
};

}  // namespace

extern const ProjectCells kProjectCellsBaseline;
const ProjectCells kProjectCellsBaseline = &project_cells<Baseline>;

}  // namespace kiroku::sim
