// The only file that knows ITK.
#include "sim/volume/itk_image.h"

#include <NrrdIO.h>
#include <algorithm>
#include <cstdint>
#include <fstream>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <map>
#include <optional>
#include <utility>

#include "base/ascii.h"
#include "base/error.h"

namespace kiroku::sim {
namespace {

using Pointer = itk::ImageIOBase::Pointer;

Pointer make_reader(ImageFormat format) {
  switch (format) {
    case ImageFormat::kNifti:
      return itk::NiftiImageIO::New().GetPointer();
    case ImageFormat::kNrrd:
      return itk::NrrdImageIO::New().GetPointer();
    case ImageFormat::kMetaImage:
      break;
  }
  return itk::MetaImageIO::New().GetPointer();
}

/// What ITK throws is of many lines; the sentence is in its description, after the name of its class.
std::string sentence_of(const itk::ExceptionObject& error) {
  std::string text = error.GetDescription();
  if (const std::size_t at = text.find("): "); at != std::string::npos) text.erase(0, at + 3);
  std::ranges::replace(text, '\n', ' ');
  while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
  return text;
}

/// Of a unit of length as headers name it; none is millimetres, as all programs take it.
double millimetres(const std::string& unit, const std::string& what) {
  const std::string name = lower_case(unit);
  if (name.empty() || name.starts_with("?") || name == "mm" || name.starts_with("millimet")) return 1;
  if (name == "cm" || name.starts_with("centimet")) return 10;
  if (name == "m" || name.starts_with("meter") || name.starts_with("metre")) return 1000;
  if (name == "um" || name == "\xC2\xB5m" || name == "\xCE\xBCm" || name.starts_with("micro")) return 0.001;
  throw Error(what + ": its unit of length is '" + unit + "', which is not known; save it in mm");
}

/// Runs what calls ITK, and makes one sentence of what it throws.
template <typename Action>
auto guarded(const std::string& what, Action action) {
  try {
    return action();
  } catch (const itk::ExceptionObject& error) {
    throw Error(what + ": it is damaged, cut off or not supported (" + sentence_of(error) + ")");
  }
}

struct FreeingNrrd {
  void operator()(Nrrd* nrrd) const { nrrdNuke(nrrd); }
  void operator()(NrrdIoState* state) const { nrrdIoStateNix(state); }
};

struct NrrdHeader {
  std::unique_ptr<Nrrd, FreeingNrrd> nrrd{nrrdNew()};
  std::unique_ptr<NrrdIoState, FreeingNrrd> state{nrrdIoStateNew()};
};

NrrdHeader nrrd_header(const std::string& file, const std::string& what) {
  NrrdHeader header;
  header.state->skipData = 1;
  if (nrrdLoad(header.nrrd.get(), file.c_str(), header.state.get()) != 0) {
    biffDone(NRRD);
    throw Error(what +
                ": its header is damaged, cut off or not supported, or the file that it names is missing");
  }
  return header;
}

/// How a header's unit and place are to be taken, as ITK takes no notice of it.
struct Placing {
  bool placed = true;
  double mm = 1;  // in the header's unit of length
};

Placing nrrd_placing(const std::string& file, const std::string& what) {
  const NrrdHeader header = nrrd_header(file, what);
  Nrrd& nrrd = *header.nrrd;
  Placing placing;
  const bool of_patient =
      nrrd.space == nrrdSpaceRightAnteriorSuperior || nrrd.space == nrrdSpaceLeftAnteriorSuperior ||
      nrrd.space == nrrdSpaceLeftPosteriorSuperior || nrrd.space == nrrdSpaceRightAnteriorSuperiorTime ||
      nrrd.space == nrrdSpaceLeftAnteriorSuperiorTime || nrrd.space == nrrdSpaceLeftPosteriorSuperiorTime;
  if (nrrd.space == nrrdSpace3DLeftHanded || nrrd.space == nrrdSpace3DLeftHandedTime) {
    throw Error(what +
                ": its space is left-handed and not the patient's, so that it would be shown as its mirror "
                "image; save it with a space of the patient, such as left-posterior-superior");
  }
  std::optional<double> mm;
  const auto take_unit = [&](const char* unit) {
    const double one = millimetres(unit == nullptr ? "" : unit, what);
    if (mm && *mm != one) throw Error(what + ": its axes are in units that differ; save it in mm");
    mm = one;
  };
  bool has_directions = false;
  for (unsigned axis = 0; axis < nrrd.dim; ++axis)
    has_directions = has_directions || nrrdSpaceVecExists(nrrd.spaceDim, nrrd.axis[axis].spaceDirection) != 0;
  if (has_directions) {
    const unsigned spatial = std::min(nrrd.spaceDim, 3U);
    for (unsigned axis = 0; axis < spatial; ++axis) take_unit(nrrd.spaceUnits[axis]);
  } else {
    for (unsigned axis = 0; axis < std::min(nrrd.dim, 3U); ++axis) take_unit(nrrd.axis[axis].units);
  }
  placing.placed = of_patient && has_directions;
  placing.mm = mm.value_or(1);
  return placing;
}

/// What a MetaImage header says of one thing; "" where it says nothing.
class MetaFields {
 public:
  explicit MetaFields(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    for (std::string line; std::getline(in, line);) {
      const std::size_t split = line.find_first_of("=:");
      if (split == std::string::npos) continue;
      std::string key = trimmed(line.substr(0, split));
      if (key == "ElementDataFile") return;
      fields_[std::move(key)] = trimmed(line.substr(split + 1));
    }
  }
  [[nodiscard]] std::string of(const std::string& key) const {
    const auto found = fields_.find(key);
    return found == fields_.end() ? "" : found->second;
  }

 private:
  static std::string trimmed(const std::string& text) {
    const std::size_t begin = text.find_first_not_of(" \t\r"), end = text.find_last_not_of(" \t\r");
    return begin == std::string::npos ? "" : text.substr(begin, end - begin + 1);
  }
  std::map<std::string, std::string> fields_;
};

/// The patient's axis and the sign of what a letter of LPS says.
std::optional<std::pair<std::size_t, double>> meaning_of(char letter) {
  switch (letter) {
    case 'L':
      return {{0, 1}};
    case 'R':
      return {{0, -1}};
    case 'P':
      return {{1, 1}};
    case 'A':
      return {{1, -1}};
    case 'S':
      return {{2, 1}};
    case 'I':
      return {{2, -1}};
    default:
      return {};
  }
}

/// AnatomicalOrientation names for each axis from where it comes ("RAI" for LPS); some programs write where
/// it goes to. ITK takes no notice of it.
Placing meta_placing(const itk::ImageIOBase& reader, const std::string& file, const std::string& what) {
  const MetaFields fields(file);
  Placing placing;
  placing.mm = millimetres(fields.of("DistanceUnits"), what);
  const bool has_matrix = !fields.of("TransformMatrix").empty() || !fields.of("Rotation").empty() ||
                          !fields.of("Orientation").empty();
  placing.placed = has_matrix;
  std::string stated = fields.of("AnatomicalOrientation");
  std::erase_if(stated, [](char c) { return c == ' ' || c == '\t'; });
  const bool says = stated.size() == 3 && std::ranges::all_of(stated, [](char letter) {
                      return meaning_of(ascii_upper(letter)).has_value();
                    });
  if (!says) return placing;
  bool from = true, to = true;
  for (unsigned axis = 0; axis < 3; ++axis) {
    const auto [of, sign] = *meaning_of(ascii_upper(stated[axis]));
    const double along = sign * reader.GetDirection(axis)[of];
    constexpr double kSaysSo = 0.1;  // oblique axes are named by the nearest of the patient's
    from = from && along < -kSaysSo;
    to = to && along > kSaysSo;
  }
  if (from || (to && has_matrix)) {
    placing.placed = true;
    return placing;
  }
  throw Error(what + ": it says AnatomicalOrientation = " + stated +
              (has_matrix ? ", which contradicts its TransformMatrix"
                          : " and has no TransformMatrix, without which its axes would be taken for left, "
                            "back and head") +
              ". Save it anew with a TransformMatrix, after a look at an organ of one side");
}

Placing placing_of(const itk::ImageIOBase& reader, const std::string& file, ImageFormat format,
                   const std::string& what) {
  if (format == ImageFormat::kNrrd) return nrrd_placing(file, what);
  if (format == ImageFormat::kMetaImage) return meta_placing(reader, file, what);
  return {};  // of NIfTI its own header says it
}

template <typename Value>
void convert(const std::vector<char>& bytes, std::vector<float>& values) {
  for (std::size_t at = 0; at < values.size(); ++at) {
    Value value;
    std::copy_n(bytes.data() + at * sizeof(Value), sizeof(Value), reinterpret_cast<char*>(&value));
    values[at] = static_cast<float>(value);
  }
}

}  // namespace

NamedData data_named_in(const std::string& file, ImageFormat format) {
  const std::string what = "cannot read " + file;
  itk::Object::SetGlobalWarningDisplay(false);
  if (format == ImageFormat::kMetaImage) {
    const auto reader = itk::MetaImageIO::New();
    guarded(what, [&] {
      reader->SetFileName(file);
      reader->ReadImageInformation();
    });
    // As MetaImage::Read() takes the name apart.
    std::string name = reader->GetMetaImagePointer()->ElementDataFileName();
    if (name == "LOCAL" || name == "Local" || name == "local") return {};
    const bool several = name.starts_with("LIST") || name.find('%') != std::string::npos;
    return {several, std::move(name)};
  }
  if (format != ImageFormat::kNrrd) return {};
  const NrrdHeader header = nrrd_header(file, what);
  const NrrdIoState* const state = header.state.get();
  if (state->dataFNFormat != nullptr) return {true, state->dataFNFormat};
  if (state->dataFNArr->len == 0) return {};
  return {state->dataFNArr->len > 1, state->dataFN[0]};
}

struct ItkImage::Reader {
  Pointer itk;
};

ItkImage::~ItkImage() = default;

ItkImage::ItkImage(const std::string& file, ImageFormat format)
    : what_("cannot read " + file), reader_(std::make_unique<Reader>()) {
  // Else its remarks go to standard error.
  itk::Object::SetGlobalWarningDisplay(false);
  guarded(what_, [&] {
    reader_->itk = make_reader(format);
    if (!reader_->itk->CanReadFile(file.c_str()))
      throw Error(what_ + ": it is not of the format that its ending says, or cut off");
    reader_->itk->SetFileName(file);
    reader_->itk->ReadImageInformation();
  });
  const itk::ImageIOBase& reader = *reader_->itk;
  const unsigned dimensions = reader.GetNumberOfDimensions();
  for (unsigned axis = 3; axis < dimensions; ++axis) {
    if (reader.GetDimensions(axis) > 1) {
      throw Error(what_ + ": it holds " + std::to_string(reader.GetDimensions(axis)) +
                  " volumes; save the one that is wanted alone");
    }
  }
  if (dimensions < 3) throw Error(what_ + ": it is a picture, not a volume");
  if (reader.GetNumberOfComponents() != 1) {
    throw Error(what_ + ": it has " + std::to_string(reader.GetNumberOfComponents()) +
                " values a voxel instead of one");
  }
  const Placing placing = placing_of(reader, file, format, what_);
  for (unsigned axis = 0; axis < 3; ++axis) {
    header_.size[axis] = reader.GetDimensions(axis);
    header_.spacing_mm[axis] = placing.mm * reader.GetSpacing(axis);
    header_.origin_mm[axis] = placing.mm * reader.GetOrigin(axis);
    std::ranges::copy_n(reader.GetDirection(axis).begin(), 3, header_.direction[axis].begin());
  }
  header_.bytes_per_voxel = reader.GetComponentSize();
  header_.placed = placing.placed;
}

std::vector<float> ItkImage::values() const {
  itk::ImageIOBase& reader = *reader_->itk;
  itk::ImageIORegion region(reader.GetNumberOfDimensions());
  for (unsigned axis = 0; axis < reader.GetNumberOfDimensions(); ++axis) {
    region.SetSize(axis, reader.GetDimensions(axis));
    region.SetIndex(axis, 0);
  }
  std::vector<float> values(header_.size[0] * header_.size[1] * header_.size[2]);
  std::vector<char> bytes(values.size() * reader.GetComponentSize());
  guarded(what_, [&] {
    reader.SetIORegion(region);
    reader.Read(bytes.data());
  });
  using Type = itk::IOComponentEnum;
  switch (reader.GetComponentType()) {
    case Type::UCHAR:
      convert<unsigned char>(bytes, values);
      break;
    case Type::CHAR:
      convert<signed char>(bytes, values);
      break;
    case Type::USHORT:
      convert<std::uint16_t>(bytes, values);
      break;
    case Type::SHORT:
      convert<std::int16_t>(bytes, values);
      break;
    case Type::UINT:
      convert<std::uint32_t>(bytes, values);
      break;
    case Type::INT:
      convert<std::int32_t>(bytes, values);
      break;
    case Type::ULONG:
      convert<unsigned long>(bytes, values);
      break;
    case Type::LONG:
      convert<long>(bytes, values);
      break;
    case Type::ULONGLONG:
      convert<unsigned long long>(bytes, values);
      break;
    case Type::LONGLONG:
      convert<long long>(bytes, values);
      break;
    case Type::FLOAT:
      convert<float>(bytes, values);
      break;
    case Type::DOUBLE:
      convert<double>(bytes, values);
      break;
    default:
      throw Error(what_ + ": its voxels are of a type that is not read");
  }
  return values;
}

}  // namespace kiroku::sim
