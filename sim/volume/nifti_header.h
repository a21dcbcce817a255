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

#include "sim/volume/grid.h"

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
  /// Whether it begins as a header of either does, so that what it says can be told.
  [[nodiscard]] bool is_known() const;

  /// Where voxels are in the patient, in the file's unit, right, front and head: both are optional.
  struct Placement {
    /// What it is counted from, as nifti1.h has it.
    int code = 0;
    /// niftilib takes no place of another code.
    [[nodiscard]] bool stated() const { return code > 0; }
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  // columns: one step along i, j and k
    Eigen::Vector3d first = Eigen::Vector3d::Zero();     // the first voxel's centre
  };
  [[nodiscard]] Placement qform() const;
  [[nodiscard]] Placement sform() const;
  /// Of length: 2 is the millimetre; 0 where the file does not say it.
  [[nodiscard]] int unit() const;
  /// Voxels along i, j and k.
  [[nodiscard]] Eigen::Vector3d size() const;
  /// Between their centres, in the file's unit: pixdim.
  [[nodiscard]] Eigen::Vector3d spacing() const;

 private:
  [[nodiscard]] double real(std::size_t at_of_first, std::size_t at_of_second) const;

  std::vector<char> bytes_;
  bool swapped_ = false, first_ = true;
};

/// What a header says of why nobody could read its file, where it says that: kiroku::Error beginning with
/// `what`.
void explain_refusal(const NiftiHeader& header, const std::string& what);

/// What a person should know of how a file places its voxels, one sentence each: that it does so twice, by
/// qform and by sform, not quite alike, and which of the two was taken, as `read` shows; and that the patient
/// was stretched to a template. kiroku::Error beginning with `what` where the file contradicts itself, so
/// that nobody can tell what is right: one place mirrors or turns what the other does not, or steps of the
/// sform are of another length than those between voxels.
std::vector<std::string> remarks_on_places(const NiftiHeader& header, const Grid& read,
                                           const std::string& what);

}  // namespace kiroku::sim
