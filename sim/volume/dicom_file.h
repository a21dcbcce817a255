// What is common to all DICOM files that are read: opening them, values of a header, and stored pixels
// (DICOM PS3.3 C.7.6.3, PS3.5 8). For the files that read one kind of picture; the only header of the
// simulation that shows DCMTK. Functions are thread-safe.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "dcmtk/config/osconfig.h"
#include "dcmtk/dcmdata/dctk.h"

namespace kiroku::sim {

bool begins_as_dicom(const std::filesystem::path& file);
/// The sentence for one that does not.
std::string no_dicom_file(const std::filesystem::path& file);

/// Large elements stay in the file until they are asked for. kiroku::Error where it is damaged or cut off, or
/// takes more than a picture may (dicom_bounds.h).
void load_dicom(DcmFileFormat& dicom, const std::filesystem::path& file);

/// Values of a header, and the names of those that are not there.
class DicomHeader {
 public:
  explicit DicomHeader(DcmDataset& dataset) : dataset_(dataset) {}

  std::string text(const DcmTagKey& tag) {
    OFString value;
    if (dataset_.findAndGetOFString(tag, value).bad()) return {};
    return {value.c_str(), value.length()};
  }

  template <std::size_t Count>
  std::array<double, Count> reals(const DcmTagKey& tag) {
    std::array<double, Count> values{};
    for (std::size_t at = 0; at < Count; ++at) {
      Float64 value = 0;
      if (dataset_.findAndGetFloat64(tag, value, at).bad() || !std::isfinite(value)) {
        lack(tag);
        return {};
      }
      values[at] = value;
    }
    return values;
  }

  std::optional<double> optional_real(const DcmTagKey& tag) {
    Float64 value = 0;
    if (dataset_.findAndGetFloat64(tag, value).bad() || !std::isfinite(value)) return std::nullopt;
    return value;
  }

  std::uint16_t count(const DcmTagKey& tag) {
    Uint16 value = 0;
    if (dataset_.findAndGetUint16(tag, value).bad()) lack(tag);
    return value;
  }

  /// Of a tag that is signed or unsigned as the pixels are.
  std::optional<std::int32_t> stored(const DcmTagKey& tag, bool is_signed) {
    Uint16 value = 0;
    Sint16 signed_value = 0;
    if (dataset_.findAndGetUint16(tag, value).bad()) {
      if (dataset_.findAndGetSint16(tag, signed_value).bad()) return std::nullopt;
      value = static_cast<Uint16>(signed_value);
    }
    return is_signed ? static_cast<std::int32_t>(static_cast<Sint16>(value))
                     : static_cast<std::int32_t>(value);
  }

  [[nodiscard]] const std::string& lacking() const { return lacking_; }

 private:
  void lack(const DcmTagKey& key) {
    DcmTag tag(key);
    lacking_ += (lacking_.empty() ? "" : ", ") + std::string(tag.getTagName()) + " " + tag.toString().c_str();
  }

  DcmDataset& dataset_;
  std::string lacking_;
};

/// How stored numbers are packed.
struct PixelPacking {
  unsigned allocated = 16, stored = 16, high_bit = 15;
  bool is_signed = false;

  /// Without bits that do not belong to the number (overlays of old files), with its sign.
  [[nodiscard]] std::int32_t value(std::uint32_t packed) const {
    const std::uint32_t bits = packed >> (high_bit + 1 - stored) & ((1U << stored) - 1);
    const bool negative = is_signed && (bits >> (stored - 1) & 1U) != 0;
    return static_cast<std::int32_t>(bits) - (negative ? static_cast<std::int32_t>(1U << stored) : 0);
  }
};

PixelPacking packing_of(DicomHeader& header);

/// Why such pixels cannot be read, to follow the file's name: " is a picture in colour"; empty if they can.
/// `several`: it may hold more than one picture.
std::string unread_pixels(DcmDataset& dataset, DicomHeader& header, const PixelPacking& packing,
                          bool several = false);
/// Number of Frames (0028,0008); 1 where it is absent.
std::int32_t frames_of(DcmDataset& dataset);

/// The one picture's stored numbers, rows from the top, decompressed if need be; of several pictures below
/// each other, where `rows` is that of all, which JPEG 2000 has not. kiroku::Error beginning with `what` for
/// a compression that is not known (named), and for damaged or missing pixels.
std::vector<std::int32_t> stored_values(DcmDataset& dataset, const PixelPacking& packing, std::size_t columns,
                                        std::size_t rows, const std::string& what);

}  // namespace kiroku::sim
