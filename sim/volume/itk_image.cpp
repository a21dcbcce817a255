// The only file that knows ITK.
#include "sim/volume/itk_image.h"

#include <NrrdIO.h>
#include <algorithm>
#include <cstdint>
#include <itkMetaDataObject.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

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

/// Runs what calls ITK, and makes one sentence of what it throws.
template <typename Action>
auto guarded(const std::string& what, Action action) {
  try {
    return action();
  } catch (const itk::ExceptionObject& error) {
    throw Error(what + ": it is damaged, cut off or not supported (" + sentence_of(error) + ")");
  }
}

/// Whether the header has a transformation to the patient, as far as the formats say so.
bool is_placed(const itk::ImageIOBase& reader, ImageFormat format) {
  const itk::MetaDataDictionary& header = reader.GetMetaDataDictionary();
  std::string qform, sform, space;
  if (format == ImageFormat::kNifti) {
    itk::ExposeMetaData(header, "qform_code", qform);
    itk::ExposeMetaData(header, "sform_code", sform);
    return (!qform.empty() && qform != "0") || (!sform.empty() && sform != "0");
  }
  return format != ImageFormat::kNrrd || itk::ExposeMetaData(header, "NRRD_space", space);
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
  struct Freeing {
    void operator()(Nrrd* nrrd) const { nrrdNuke(nrrd); }
    void operator()(NrrdIoState* state) const { nrrdIoStateNix(state); }
  };
  const std::unique_ptr<Nrrd, Freeing> nrrd(nrrdNew());
  const std::unique_ptr<NrrdIoState, Freeing> state(nrrdIoStateNew());
  state->skipData = 1;
  if (nrrdLoad(nrrd.get(), file.c_str(), state.get()) != 0) {
    biffDone(NRRD);
    throw Error(what +
                ": its header is damaged, cut off or not supported, or the file that it names is missing");
  }
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
  for (unsigned axis = 0; axis < 3; ++axis) {
    header_.size[axis] = reader.GetDimensions(axis);
    header_.spacing_mm[axis] = reader.GetSpacing(axis);
    header_.origin_mm[axis] = reader.GetOrigin(axis);
    std::ranges::copy_n(reader.GetDirection(axis).begin(), 3, header_.direction[axis].begin());
  }
  header_.bytes_per_voxel = reader.GetComponentSize();
  header_.placed = is_placed(reader, format);
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
