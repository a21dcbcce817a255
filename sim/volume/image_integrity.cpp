#include "sim/volume/image_integrity.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <zlib.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

[[noreturn]] void refuse(const std::string& file, const std::string& why) { refuse_damaged(file, why); }

/// Where the voxels are and how large.
struct NiftiLayout {
  std::size_t begin = 0, bytes_per_voxel = 0;
  std::int16_t type = 0;
};
constexpr std::int16_t kFloat32 = 16, kFloat64 = 64;

NiftiLayout layout_of(const std::string& file, const NiftiHeader& header) {
  NiftiLayout layout;
  layout.type = header.number<std::int16_t>(header.is_first() ? 70 : 12);
  layout.bytes_per_voxel =
      static_cast<std::size_t>(header.number<std::int16_t>(header.is_first() ? 72 : 14)) / 8;
  const double begin = header.is_first() ? static_cast<double>(header.number<float>(108))
                                         : static_cast<double>(header.number<std::int64_t>(168));
  constexpr double kMostHeader = 1U << 30U;
  if (!(begin >= 0 && begin < kMostHeader) || layout.bytes_per_voxel == 0 || layout.bytes_per_voxel > 16) {
    refuse(file, "its header does not say where its voxels are");
  }
  layout.begin = static_cast<std::size_t>(begin);
  return layout;
}

template <typename Real>
bool is_finite(const char* bytes, bool swapped) {
  std::array<char, sizeof(Real)> copy{};
  std::copy_n(bytes, sizeof(Real), copy.begin());
  if (swapped) std::ranges::reverse(copy);
  return std::isfinite(std::bit_cast<Real>(copy));
}

}  // namespace

std::vector<std::size_t> check_nifti(const GzipFile& stream, const NiftiHeader& header,
                                     const std::string& file, std::size_t voxels) {
  const NiftiLayout layout = layout_of(file, header);
  if (gzseek(stream.get(), static_cast<z_off_t>(layout.begin), SEEK_SET) < 0)
    refuse(file, "it ends before its voxels");
  std::vector<std::size_t> not_finite;
  std::vector<char> block(layout.bytes_per_voxel << 16U);
  for (std::size_t done = 0; done < voxels;) {
    const std::size_t wanted = std::min(block.size() / layout.bytes_per_voxel, voxels - done);
    const std::size_t got = read_gzip(stream, file, block.data(), wanted * layout.bytes_per_voxel);
    if (got < wanted * layout.bytes_per_voxel) {
      refuse(file, "it holds " + std::to_string(done + got / layout.bytes_per_voxel) + " of " +
                       std::to_string(voxels) + " voxels");
    }
    for (std::size_t voxel = 0; voxel < wanted; ++voxel) {
      const char* const bytes = block.data() + voxel * layout.bytes_per_voxel;
      const bool finite = layout.type == kFloat32   ? is_finite<float>(bytes, header.is_swapped())
                          : layout.type == kFloat64 ? is_finite<double>(bytes, header.is_swapped())
                                                    : true;
      if (!finite) not_finite.push_back(done + voxel);
    }
    done += wanted;
  }
  return not_finite;
}

void check_meta_image(const std::string& file, std::size_t bytes) {
  std::ifstream in(file, std::ios::binary);
  std::string line, data_file;
  std::size_t needed = bytes, begin = 0;
  bool compressed = false;
  while (data_file.empty() && std::getline(in, line)) {
    const std::size_t equals = line.find('=');
    if (equals == std::string::npos) continue;
    const auto trimmed = [](std::string text) {
      std::erase_if(text, [](char c) { return c == ' ' || c == '\t' || c == '\r'; });
      return text;
    };
    const std::string key = trimmed(line.substr(0, equals)), value = trimmed(line.substr(equals + 1));
    if (key == "CompressedData") compressed = value == "True" || value == "true" || value == "1";
    if (key == "CompressedDataSize") std::from_chars(value.data(), value.data() + value.size(), needed);
    if (key == "ElementDataFile") data_file = value;
  }
  if (!compressed) needed = bytes;
  std::filesystem::path data = file;
  if (data_file == "LOCAL" || data_file == "Local" || data_file == "local") {
    begin = static_cast<std::size_t>(std::max<std::streamoff>(in.tellg(), 0));
  } else {
    data = std::filesystem::path(file).parent_path() / data_file;
    // Lists and patterns of several files are ITK's to read.
    if (!std::filesystem::is_regular_file(data)) return;
  }
  const std::size_t there = static_cast<std::size_t>(std::filesystem::file_size(data)) - begin;
  // Where compressed data do not say how long they are, damage shows when they are unpacked.
  if (compressed && needed == bytes) return;
  if (there < needed) {
    refuse(file, "it holds " + std::to_string(there) + " of " + std::to_string(needed) + " bytes");
  }
}

}  // namespace kiroku::sim
