// A CT with an organ to push aside, and its labels, as NRRD files: flat like a liver's left lobe, 18 cm wide,
// 4 cm from front to back, 12 cm from its lower border up; in patient coordinates, voxels of 4 mm.
#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

namespace kiroku::test {

inline void write_flat_organ(const std::filesystem::path& file, int within, int outside) {
  constexpr int kAcross = 50, kThick = 16, kHigh = 36;
  std::string text =
      "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 50 16 36\n"
      "space directions: (4,0,0) (0,4,0) (0,0,4)\nspace origin: (-98,-230,110)\nencoding: raw\nendian: "
      "little\n\n";
  for (int k = 0; k < kHigh; ++k) {
    for (int j = 0; j < kThick; ++j) {
      for (int i = 0; i < kAcross; ++i) {
        const double x = (4 * i - 98) / 90.0, y = (4 * j - 30) / 20.0, z = (4 * k - 70) / 60.0;
        const auto value =
            static_cast<std::uint16_t>(std::pow(x, 4) + y * y + std::pow(z, 4) < 1 ? within : outside);
        text += static_cast<char>(value & 0xffU);
        text += static_cast<char>(value >> 8U);
      }
    }
  }
  std::ofstream(file, std::ios::binary) << text;
}

/// "ct.nrrd", "labels.nrrd" and the document "left lobe.json" of that organ in `folder`; the document.
inline std::filesystem::path write_flat_organ_document(const std::filesystem::path& folder,
                                                       const std::string& more = "") {
  write_flat_organ(folder / "ct.nrrd", 40, -1000);
  write_flat_organ(folder / "labels.nrrd", 5, 0);
  const std::filesystem::path file = folder / "left lobe.json";
  std::ofstream(file) << R"({"mesh": {"labels": "labels.nrrd", "organ": "liver", "vertices": 1500},
      "volume": "ct.nrrd", "length_unit": "mm",
      "materials": [{"region": "all", "young_modulus_pa": 20000, "poisson_ratio": 0.4}])"
                      << more << "}";
  return file;
}

}  // namespace kiroku::test
