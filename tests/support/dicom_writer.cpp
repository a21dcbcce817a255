#include "tests/support/dicom_writer.h"

#include <mutex>
#include <stdexcept>

#include "dcmtk/config/osconfig.h"
#include "dcmtk/dcmdata/dcrleerg.h"
#include "dcmtk/dcmdata/dctk.h"
#include "dcmtk/dcmjpeg/djencode.h"
#include "dcmtk/dcmjpls/djencode.h"

namespace kiroku::test {
namespace {

void require(const OFCondition& done, const std::string& what) {
  if (done.bad()) throw std::runtime_error(what + ": " + done.text());
}

std::string decimals(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) {
    std::array<char, 32> digits{};
    std::snprintf(digits.data(), digits.size(), "%.10g", value);
    text += (text.empty() ? "" : "\\") + std::string(digits.data());
  }
  return text;
}

DcmTagKey key_of(const std::string& text) {
  unsigned group = 0, element = 0;
  if (std::sscanf(text.c_str(), "(%x,%x)", &group, &element) != 2)
    throw std::runtime_error("no tag: " + text);
  return {static_cast<Uint16>(group), static_cast<Uint16>(element)};
}

E_TransferSyntax syntax_of(DicomCompression compression) {
  switch (compression) {
    case DicomCompression::kRunLength:
      return EXS_RLELossless;
    case DicomCompression::kJpegLossless:
      return EXS_JPEGProcess14SV1;
    case DicomCompression::kJpegLs:
      return EXS_JPEGLSLossless;
    case DicomCompression::kNone:
      break;
  }
  return EXS_LittleEndianExplicit;
}

void register_encoders() {
  static std::once_flag once;
  std::call_once(once, [] {
    DcmRLEEncoderRegistration::registerCodecs();
    DJEncoderRegistration::registerCodecs();
    DJLSEncoderRegistration::registerCodecs();
  });
}

}  // namespace

void write_dicom(const std::filesystem::path& file, const DicomSlice& slice) {
  register_encoders();
  DcmFileFormat dicom;
  DcmDataset& dataset = *dicom.getDataset();
  const auto put = [&](const DcmTagKey& key, const std::string& value) {
    require(dataset.putAndInsertString(key, value.c_str()), "put " + value);
  };
  const auto put_number = [&](const DcmTagKey& key, std::uint16_t value) {
    require(dataset.putAndInsertUint16(key, value), "put a number");
  };
  put(DCM_SOPClassUID, UID_CTImageStorage);
  put(DCM_SOPInstanceUID, slice.instance_uid);
  put(DCM_Modality, "CT");
  put(DCM_SeriesInstanceUID, slice.series_uid);
  put(DCM_SeriesDescription, slice.description);
  put(DCM_ImagePositionPatient,
      decimals({slice.position_mm.x(), slice.position_mm.y(), slice.position_mm.z()}));
  put(DCM_ImageOrientationPatient,
      decimals({slice.along_row.x(), slice.along_row.y(), slice.along_row.z(), slice.down_column.x(),
                slice.down_column.y(), slice.down_column.z()}));
  put(DCM_PixelSpacing, decimals({slice.row_spacing_mm, slice.column_spacing_mm}));
  put(DCM_RescaleSlope, decimals({slice.slope}));
  put(DCM_RescaleIntercept, decimals({slice.intercept}));
  put(DCM_PhotometricInterpretation, "MONOCHROME2");
  put_number(DCM_SamplesPerPixel, 1);
  put_number(DCM_Rows, slice.rows);
  put_number(DCM_Columns, slice.columns);
  put_number(DCM_BitsAllocated, 16);
  put_number(DCM_BitsStored, slice.bits_stored);
  put_number(DCM_HighBit, static_cast<std::uint16_t>(slice.bits_stored - 1));
  put_number(DCM_PixelRepresentation, slice.is_signed ? 1 : 0);
  require(dataset.putAndInsertUint16Array(DCM_PixelData, slice.stored.data(), slice.stored.size()),
          "put pixels");
  // Its JPEG-LS encoder keeps room for the pixels alone, and writes beyond that where header and padding are
  // larger.
  constexpr std::size_t kLeastOfJpegLs = 512;
  if (slice.compression == DicomCompression::kJpegLs && slice.stored.size() < kLeastOfJpegLs)
    throw std::runtime_error("DCMTK codes no picture of fewer than " + std::to_string(kLeastOfJpegLs) +
                             " pixels in JPEG-LS without writing beyond its memory");
  const E_TransferSyntax syntax = syntax_of(slice.compression);
  if (slice.compression != DicomCompression::kNone) {
    require(dataset.chooseRepresentation(syntax, nullptr), "compress");
  }
  for (const auto& [tag, value] : slice.elements) {
    if (value.empty()) {
      dataset.findAndDeleteElement(key_of(tag));
    } else {
      // Padding is signed or unsigned as the pixels are, which DCMTK does not guess.
      const bool is_padding = tag.starts_with("(0028,012");
      if (is_padding) {
        put_number(key_of(tag), static_cast<std::uint16_t>(std::stoi(value)));
      } else {
        put(key_of(tag), value);
      }
    }
  }
  require(dicom.saveFile(file.c_str(), syntax), "save " + file.string());
}

}  // namespace kiroku::test
