// Units at the border: files and models say which they are in, everything inside is in metres.
#pragma once

namespace kiroku::sim {

inline constexpr double kMmPerM = 1000;

enum class LengthUnit { kMetre, kMillimetre };

/// Dividing by it is exact where multiplying by 0.001 is not.
constexpr double units_per_metre(LengthUnit unit) { return unit == LengthUnit::kMetre ? 1.0 : kMmPerM; }

}  // namespace kiroku::sim
