// ITK's readers behind plain numbers: ITK brings an Eigen of its own, older than the project's, so nothing
// that includes one may include the other.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace kiroku::sim {

enum class ImageFormat { kNifti, kNrrd, kMetaImage };

/// Where the voxels lie that belong to a header, as the reader finds it: what stands in the header decides,
/// and not the file's ending.
struct NamedData {
  bool several = false;  // a list of files, or a pattern
  std::string file;      // as the header names it; empty where the header's own file holds the voxels
};
/// kiroku::Error for a header that ITK does not read.
NamedData data_named_in(const std::string& file, ImageFormat format);

/// One file. Not thread-safe. kiroku::Error beginning with "cannot read FILE: " for whatever ITK refuses.
class ItkImage {
 public:
  /// Reads the header.
  ItkImage(const std::string& file, ImageFormat format);
  ~ItkImage();
  ItkImage(const ItkImage&) = delete;
  ItkImage& operator=(const ItkImage&) = delete;

  struct Header {
    std::array<std::size_t, 3> size{};
    std::array<double, 3> spacing_mm{}, origin_mm{};
    std::array<std::array<double, 3>, 3> direction{};  // of each axis, in LPS
    std::size_t bytes_per_voxel = 0;  // of what is read, not of what is stored where a slope is applied
    /// The file says how it lies in the patient. Not told of NIfTI: NiftiHeader does.
    bool placed = true;
  };
  [[nodiscard]] const Header& header() const { return header_; }

  /// All voxels, the first axis fastest, after the file's own slope and intercept.
  [[nodiscard]] std::vector<float> values() const;

 private:
  struct Reader;
  std::string what_;
  std::unique_ptr<Reader> reader_;
  Header header_;
};

}  // namespace kiroku::sim
