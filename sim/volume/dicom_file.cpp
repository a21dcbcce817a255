#include "sim/volume/dicom_file.h"

#include <algorithm>
#include <fstream>
#include <mutex>

#include "base/bytes.h"
#include "base/error.h"
#include "dcmtk/dcmdata/dcpixel.h"
#include "dcmtk/dcmdata/dcpixseq.h"
#include "dcmtk/dcmdata/dcpxitem.h"
#include "dcmtk/dcmdata/dcrledrg.h"
#include "dcmtk/dcmjpeg/djdecode.h"
#include "dcmtk/dcmjpls/djdecode.h"
#include "dcmtk/oflog/oflog.h"
#include "sim/volume/dicom_bounds.h"
#include "sim/volume/jpeg2000.h"

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

/// Whether a picture of that syntax must be decoded.
bool is_encapsulated(E_TransferSyntax syntax) {
#if OFFIS_DCMTK_VERSION_NUMBER >= 369  // where isEncapsulated() is deprecated
  return DcmXfer(syntax).usesEncapsulatedFormat();
#else
  return DcmXfer(syntax).isEncapsulated();
#endif
}

}  // namespace

bool begins_as_dicom(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<char, 132> begin{};
  in.read(begin.data(), begin.size());
  return in.gcount() == static_cast<std::streamsize>(begin.size()) &&
         std::string_view(begin.data() + 128, 4) == "DICM";
}

std::string no_dicom_file(const std::filesystem::path& file) {
  return "cannot read " + file.string() + ": it is no DICOM file, or cut off: 'DICM' is not where it must be";
}

void load_dicom(DcmFileFormat& dicom, const std::filesystem::path& file) {
  prepare_dcmtk();
  require_bounded_dicom(file);
  const OFCondition loaded = dicom.loadFile(file.c_str(), EXS_Unknown, EGL_noChange, 4096);
  if (loaded.bad()) {
    throw Error("cannot read " + file.string() + ": it is damaged or cut off (" + loaded.text() + ")");
  }
}

PixelPacking packing_of(DicomHeader& header) {
  PixelPacking packing;
  packing.allocated = header.count(DCM_BitsAllocated);
  packing.stored = header.count(DCM_BitsStored);
  packing.is_signed = header.count(DCM_PixelRepresentation) != 0;
  const std::optional<std::int32_t> high_bit = header.stored(DCM_HighBit, false);
  packing.high_bit = high_bit ? static_cast<unsigned>(*high_bit) : packing.stored - 1;
  return packing;
}

std::int32_t frames_of(DcmDataset& dataset) {
  Sint32 frames = 1;
  return dataset.findAndGetSint32(DCM_NumberOfFrames, frames).good() ? frames : 1;
}

std::string unread_pixels(DcmDataset& dataset, DicomHeader& header, const PixelPacking& packing,
                          bool several) {
  if (header.stored(DCM_SamplesPerPixel, false).value_or(1) != 1) return " is a picture in colour";
  if (const std::int32_t frames = frames_of(dataset); frames != 1 && !several) {
    return " holds " + std::to_string(frames) +
           " pictures in one file (multi-frame), which is not read; save it as one file a slice";
  }
  if ((packing.allocated != 8 && packing.allocated != 16) || packing.stored == 0 ||
      packing.stored > packing.allocated || packing.high_bit + 1 < packing.stored ||
      packing.high_bit >= packing.allocated) {
    return " stores pixels as " + std::to_string(packing.stored) + " bits of " +
           std::to_string(packing.allocated) + ", which is not read";
  }
  return {};
}

std::vector<std::int32_t> stored_values(DcmDataset& dataset, const PixelPacking& packing, std::size_t columns,
                                        std::size_t rows, const std::string& what) {
  DcmElement* element = nullptr;
  if (dataset.findAndGetElement(DCM_PixelData, element).bad()) throw Error(what + ": it has no pixels");
  auto* const pixels = dynamic_cast<DcmPixelData*>(element);
  if (pixels == nullptr) throw Error(what + ": its pixels are of an unknown kind");
  const E_TransferSyntax syntax = dataset.getOriginalXfer();
  std::vector<std::int32_t> values(rows * columns);
  if (syntax == EXS_JPEG2000 || syntax == EXS_JPEG2000LosslessOnly) {
    values = decode_jpeg2000(encapsulated_bytes(*pixels, syntax, what), columns, rows, what);
    // Decoded numbers begin at bit 0, wherever the high bit is said to be.
    PixelPacking decoded = packing;
    decoded.high_bit = packing.stored - 1;
    std::ranges::transform(values, values.begin(), [&](std::int32_t value) {
      return decoded.value(static_cast<std::uint32_t>(value));
    });
    return values;
  }
  if (is_encapsulated(syntax) && dataset.chooseRepresentation(EXS_LittleEndianExplicit, nullptr).bad()) {
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

}  // namespace kiroku::sim
