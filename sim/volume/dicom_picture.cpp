// The only file of the simulation that knows DCMTK.
#include "sim/volume/dicom_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <mutex>

#include "base/bytes.h"
#include "base/error.h"
#include "dcmtk/config/osconfig.h"
#include "dcmtk/dcmdata/dcpixel.h"
#include "dcmtk/dcmdata/dcpixseq.h"
#include "dcmtk/dcmdata/dcpxitem.h"
#include "dcmtk/dcmdata/dcrledrg.h"
#include "dcmtk/dcmdata/dctk.h"
#include "dcmtk/dcmjpeg/djdecode.h"
#include "dcmtk/dcmjpls/djdecode.h"
#include "dcmtk/oflog/oflog.h"
#include "sim/volume/jpeg2000.h"
#include "sim/volume/volume.h"

namespace kiroku::sim {
namespace {

/// Decoders are DCMTK's global state; its log would write patients' names to standard error.
void prepare_dcmtk() {
  static std::once_flag once;
  std::call_once(once, [] {
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    DcmRLEDecoderRegistration::registerCodecs();
    DJDecoderRegistration::registerCodecs();
    DJLSDecoderRegistration::registerCodecs();
  });
}

bool begins_as_dicom(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<char, 132> begin{};
  in.read(begin.data(), begin.size());
  return in.gcount() == static_cast<std::streamsize>(begin.size()) &&
         std::string_view(begin.data() + 128, 4) == "DICM";
}

/// Large elements stay in the file until they are asked for.
void load(DcmFileFormat& dicom, const std::filesystem::path& file) {
  const OFCondition loaded = dicom.loadFile(file.c_str(), EXS_Unknown, EGL_noChange, 4096);
  if (loaded.bad()) {
    throw Error("cannot read " + file.string() + ": it is damaged or cut off (" + loaded.text() + ")");
  }
}

/// Values of a header, and the names of those that are not there.
class Header {
 public:
  explicit Header(DcmDataset& dataset) : dataset_(dataset) {}

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
struct Packing {
  unsigned allocated = 16, stored = 16, high_bit = 15;
  bool is_signed = false;

  /// Without bits that do not belong to the number (overlays of old files), with its sign.
  [[nodiscard]] std::int32_t value(std::uint32_t packed) const {
    const std::uint32_t bits = packed >> (high_bit + 1 - stored) & ((1U << stored) - 1);
    const bool negative = is_signed && (bits >> (stored - 1) & 1U) != 0;
    return static_cast<std::int32_t>(bits) - (negative ? static_cast<std::int32_t>(1U << stored) : 0);
  }
};

Packing packing_of(Header& header) {
  Packing packing;
  packing.allocated = header.count(DCM_BitsAllocated);
  packing.stored = header.count(DCM_BitsStored);
  packing.is_signed = header.count(DCM_PixelRepresentation) != 0;
  const std::optional<std::int32_t> high_bit = header.stored(DCM_HighBit, false);
  packing.high_bit = high_bit ? static_cast<unsigned>(*high_bit) : packing.stored - 1;
  return packing;
}

bool is_unit(const Vector3& direction) { return std::abs(direction.norm() - 1) < 0.01; }

std::string defect_of(const DicomPicture& picture, const Packing& packing, DcmDataset& dataset,
                      Header& header) {
  const std::string name = picture.file.filename().string();
  if (!header.lacking().empty()) return name + " lacks " + header.lacking();
  if (header.stored(DCM_SamplesPerPixel, false).value_or(1) != 1) return name + " is a picture in colour";
  Sint32 frames = 1;
  if (dataset.findAndGetSint32(DCM_NumberOfFrames, frames).good() && frames != 1) {
    return name + " holds " + std::to_string(frames) +
           " pictures in one file (multi-frame), which is not read; save it as one file a slice";
  }
  if ((packing.allocated != 8 && packing.allocated != 16) || packing.stored == 0 ||
      packing.stored > packing.allocated || packing.high_bit + 1 < packing.stored ||
      packing.high_bit >= packing.allocated) {
    return name + " stores pixels as " + std::to_string(packing.stored) + " bits of " +
           std::to_string(packing.allocated) + ", which is not read";
  }
  if (picture.rows == 0 || picture.columns == 0) return name + " has no pixels";
  if (!(picture.row_spacing_m > 0 && picture.column_spacing_m > 0))
    return name + " has a PixelSpacing that is not positive";
  if (!is_unit(picture.along_row) || !is_unit(picture.down_column) ||
      std::abs(picture.along_row.dot(picture.down_column)) > 0.01) {
    return name + " has an ImageOrientationPatient that is no pair of unit vectors at right angles";
  }
  if (picture.slope == 0) return name + " has a RescaleSlope of 0";
  return {};
}

Vector3 vector_of(const double* values) { return {values[0], values[1], values[2]}; }

/// All fragments of the one frame, behind the offset table.
Bytes encapsulated_bytes(DcmPixelData& pixels, E_TransferSyntax syntax, const std::string& what) {
  DcmPixelSequence* sequence = nullptr;
  if (pixels.getEncapsulatedRepresentation(syntax, nullptr, sequence).bad() || sequence == nullptr) {
    throw Error(what + ": its compressed picture is not there");
  }
  Bytes bytes;
  for (unsigned long item = 1; item < sequence->card(); ++item) {
    DcmPixelItem* fragment = nullptr;
    Uint8* data = nullptr;
    if (sequence->getItem(fragment, item).bad() || fragment->getUint8Array(data).bad() || data == nullptr) {
      throw Error(what + ": its compressed picture is cut off");
    }
    append(bytes, std::as_bytes(std::span(data, fragment->getLength())));
  }
  return bytes;
}

std::vector<std::int32_t> stored_values(DcmDataset& dataset, const Packing& packing,
                                        const DicomPicture& picture, const std::string& what) {
  DcmElement* element = nullptr;
  if (dataset.findAndGetElement(DCM_PixelData, element).bad()) throw Error(what + ": it has no pixels");
  auto* const pixels = dynamic_cast<DcmPixelData*>(element);
  if (pixels == nullptr) throw Error(what + ": its pixels are of an unknown kind");
  const E_TransferSyntax syntax = dataset.getOriginalXfer();
  std::vector<std::int32_t> values(picture.rows * picture.columns);
  if (syntax == EXS_JPEG2000 || syntax == EXS_JPEG2000LosslessOnly) {
    values = decode_jpeg2000(encapsulated_bytes(*pixels, syntax, what), picture.columns, picture.rows, what);
    // Decoded numbers begin at bit 0, wherever the high bit is said to be.
    Packing decoded = packing;
    decoded.high_bit = packing.stored - 1;
    std::ranges::transform(values, values.begin(), [&](std::int32_t value) {
      return decoded.value(static_cast<std::uint32_t>(value));
    });
    return values;
  }
  if (DcmXfer(syntax).isEncapsulated() &&
      dataset.chooseRepresentation(EXS_LittleEndianExplicit, nullptr).bad()) {
    throw Error(what + ": its picture is compressed as '" + DcmXfer(syntax).getXferName() +
                "', and cannot be decoded: it is damaged, or that compression is not known here");
  }
  const auto read = [&](const auto* data) {
    for (std::size_t at = 0; at < values.size(); ++at) values[at] = packing.value(data[at]);
  };
  const std::size_t expected = values.size() * packing.allocated / 8;
  Uint8* bytes = nullptr;
  Uint16* words = nullptr;
  const bool found = packing.allocated == 8 ? pixels->getUint8Array(bytes).good() && bytes != nullptr
                                            : pixels->getUint16Array(words).good() && words != nullptr;
  if (!found || pixels->getLength() < expected) {
    throw Error(what + ": its pixels are cut off: " + std::to_string(pixels->getLength()) +
                " bytes instead of " + std::to_string(expected));
  }
  if (packing.allocated == 8) {
    read(bytes);
  } else {
    read(words);
  }
  return values;
}

}  // namespace

std::optional<DicomPicture> read_dicom_header(const std::filesystem::path& file) {
  prepare_dcmtk();
  if (!begins_as_dicom(file)) {
    if (file.extension() == ".dcm" || file.extension() == ".DCM") {
      throw Error("cannot read " + file.string() +
                  ": it is no DICOM file, or cut off: 'DICM' is not where it must be");
    }
    return std::nullopt;
  }
  DcmFileFormat dicom;
  load(dicom, file);
  DcmDataset& dataset = *dicom.getDataset();
  if (!dataset.tagExists(DCM_PixelData)) {
    // Cut off between two elements, a file looks whole.
    OFString kind;
    dicom.getMetaInfo()->findAndGetOFString(DCM_MediaStorageSOPClassUID, kind);
    if (kind == UID_CTImageStorage)
      throw Error("cannot read " + file.string() + ": it is a CT picture without pixels, or cut off");
    return std::nullopt;
  }
  Header header(dataset);
  DicomPicture picture;
  picture.file = file;
  picture.series_uid = header.text(DCM_SeriesInstanceUID);
  picture.series_description = header.text(DCM_SeriesDescription);
  picture.modality = header.text(DCM_Modality);
  picture.instance_uid = header.text(DCM_SOPInstanceUID);
  picture.patient_position = header.text(DCM_PatientPosition);
  picture.rows = header.count(DCM_Rows);
  picture.columns = header.count(DCM_Columns);
  picture.position_m = vector_of(header.reals<3>(DCM_ImagePositionPatient).data()) / 1000;
  const std::array<double, 6> orientation = header.reals<6>(DCM_ImageOrientationPatient);
  picture.along_row = vector_of(orientation.data());
  picture.down_column = vector_of(orientation.data() + 3);
  // The first is the distance between rows (PS3.3 10.7.1.3).
  const std::array<double, 2> spacing = header.reals<2>(DCM_PixelSpacing);
  picture.row_spacing_m = spacing[0] / 1000;
  picture.column_spacing_m = spacing[1] / 1000;
  picture.slope = header.reals<1>(DCM_RescaleSlope)[0];
  picture.intercept = header.reals<1>(DCM_RescaleIntercept)[0];
  picture.gantry_tilt_deg = header.optional_real(DCM_GantryDetectorTilt);
  const Packing packing = packing_of(header);
  if (const auto padding = header.stored(DCM_PixelPaddingValue, packing.is_signed)) {
    const std::int32_t limit =
        header.stored(DCM_PixelPaddingRangeLimit, packing.is_signed).value_or(*padding);
    picture.padding = {std::min(*padding, limit), std::max(*padding, limit)};
  }
  picture.defect = defect_of(picture, packing, dataset, header);
  return picture;
}

DicomPixels read_dicom_pixels(const DicomPicture& picture) {
  prepare_dcmtk();
  const std::string what = "cannot read " + picture.file.string();
  DcmFileFormat dicom;
  load(dicom, picture.file);
  Header header(*dicom.getDataset());
  const std::vector<std::int32_t> stored =
      stored_values(*dicom.getDataset(), packing_of(header), picture, what);
  DicomPixels pixels;
  pixels.hu.reserve(stored.size());
  for (const std::int32_t value : stored) {
    const double hu = picture.slope * value + picture.intercept;
    const bool is_padding = hu <= kPaddingHu || (picture.padding && value >= (*picture.padding)[0] &&
                                                 value <= (*picture.padding)[1]);
    if (is_padding) ++pixels.padding;
    pixels.hu.push_back(is_padding ? kAirHu : static_cast<float>(hu));
  }
  return pixels;
}

}  // namespace kiroku::sim
