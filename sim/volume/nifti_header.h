// The header of a NIfTI file, as nifti1.h and nifti2.h lay it out, compressed or not. Thread-safe.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>
#include <zlib.h>

#include <Eigen/Core>

namespace kiroku::sim {

struct GzipCloser {
  void operator()(gzFile file) const { gzclose(file); }
};
using GzipFile = std::unique_ptr<gzFile_s, GzipCloser>;
/// Reads what is not compressed as it is. kiroku::Error where it cannot be opened, or is damaged.
GzipFile open_gzip(const std::string& file);
std::size_t read_gzip(const GzipFile& stream, const std::string& file, char* into, std::size_t wanted);
/// Throws kiroku::Error.
[[noreturn]] void refuse_damaged(const std::string& file, const std::string& why);

class NiftiHeader {
 public:
  /// From the beginning of the file. kiroku::Error where it is not whole.
  static NiftiHeader read(const GzipFile& stream, const std::string& file);

  /// In the file's byte order.
  template <typename Number>
  [[nodiscard]] Number number(std::size_t at) const {
    std::array<char, sizeof(Number)> bytes{};
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), sizeof(Number), bytes.begin());
    if (swapped_) std::ranges::reverse(bytes);
    return std::bit_cast<Number>(bytes);
  }
  [[nodiscard]] bool is_swapped() const { return swapped_; }
  [[nodiscard]] bool is_first() const { return first_; }  // NIfTI-1, not NIfTI-2

  /// Where voxels are in the patient, in the file's unit, right, front and head: both are optional.
  struct Placement {
    bool stated = false;
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  // columns: one step along i, j and k
    Eigen::Vector3d first = Eigen::Vector3d::Zero();     // the first voxel's centre
  };
  [[nodiscard]] Placement qform() const;
  [[nodiscard]] Placement sform() const;
  /// Of length: 2 is the millimetre; 0 where the file does not say it.
  [[nodiscard]] int unit() const;
  /// Voxels along i, j and k.
  [[nodiscard]] Eigen::Vector3d size() const;

 private:
  [[nodiscard]] double real(std::size_t at_of_first, std::size_t at_of_second) const;

  std::vector<char> bytes_;
  bool swapped_ = false, first_ = true;
};

/// What a person should know of a file that places its voxels twice, by qform and by sform, not quite alike;
/// "" where it does not. kiroku::Error beginning with `what` where the two contradict each other: one mirrors
/// or turns what the other does not, and nobody can tell which is right.
std::string remark_on_placements(const NiftiHeader& header, const std::string& what);

}  // namespace kiroku::sim
