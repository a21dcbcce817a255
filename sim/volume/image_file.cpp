#include "sim/volume/image_file.h"

#include <algorithm>
#include <limits>

#include "base/ascii.h"
#include "base/error.h"
#include "sim/volume/image_integrity.h"
#include "sim/volume/itk_image.h"
#include "sim/volume/nifti_header.h"

namespace kiroku::sim {
namespace {

struct Ending {
  std::string_view text, name;
  ImageFormat format;
};
constexpr std::array<Ending, 6> kEndings{{{".nii", "NIfTI", ImageFormat::kNifti},
                                          {".nii.gz", "NIfTI", ImageFormat::kNifti},
                                          {".nrrd", "NRRD", ImageFormat::kNrrd},
                                          {".nhdr", "NRRD", ImageFormat::kNrrd},
                                          {".mha", "MetaImage", ImageFormat::kMetaImage},
                                          {".mhd", "MetaImage", ImageFormat::kMetaImage}}};

const Ending* ending_of(const std::filesystem::path& file) {
  const std::string name = lower_case(file.filename().string());
  const auto found =
      std::ranges::find_if(kEndings, [&](const Ending& ending) { return name.ends_with(ending.text); });
  return found == kEndings.end() ? nullptr : &*found;
}

/// niftilib reads the header of organs.nii.gz, and the voxels of organs.nii where that lies beside it.
void require_own_voxels(const std::filesystem::path& file, const std::string& what) {
  constexpr std::string_view kCompressed = ".gz";
  const std::string name = file.filename().string();
  if (!lower_case(name).ends_with(".nii.gz")) return;
  const std::filesystem::path other = file.parent_path() / name.substr(0, name.size() - kCompressed.size());
  std::error_code unknown;
  if (std::filesystem::exists(other, unknown)) {
    throw Error(what + ": " + other.filename().string() +
                " lies beside it, and its voxels would be taken instead; move one of the two away");
  }
}

/// ITK's own sentences do not say what of a header contradicts itself.
ItkImage open_image(const std::string& file, ImageFormat format, const std::optional<NiftiHeader>& nifti,
                    const std::string& what) {
  try {
    return ItkImage(file, format);
  } catch (const Error&) {
    if (nifti) explain_refusal(*nifti, what);
    throw;
  }
}

}  // namespace

bool is_image_file(const std::filesystem::path& file) { return ending_of(file) != nullptr; }

std::optional<std::string> data_file_of(const std::filesystem::path& file) {
  const Ending* const ending = ending_of(file);
  if (ending == nullptr) return std::nullopt;
  const NamedData data = data_named_in(file.string(), ending->format);
  const std::string use = "; save the volume as one .mha or .nrrd file, or with one file of voxels beside it";
  if (data.several) throw Error(file.string() + " has its voxels in several files" + use);
  if (data.file.empty()) return std::nullopt;
  // NRRD's reader takes "-" for what comes in from elsewhere.
  if (std::filesystem::path(data.file).is_absolute() || data.file == "-")
    throw Error(file.string() + " has its voxels in " + data.file + use);
  return data.file;
}

ImageFile read_image_file(const std::filesystem::path& file) {
  const Ending* const ending = ending_of(file);
  const std::string what = "cannot read " + file.string();
  if (ending == nullptr) {
    throw UsageError(what +
                     ": the ending of a volume's file must be .nii, .nii.gz, .nrrd, .nhdr, .mha or .mhd");
  }
  require_own_voxels(file, what);
  GzipFile stream;
  std::optional<NiftiHeader> nifti;
  if (ending->format == ImageFormat::kNifti) {
    stream = open_gzip(file.string());
    nifti = NiftiHeader::read(stream, file.string());
  }
  const ItkImage itk = open_image(file.string(), ending->format, nifti, what);
  const ItkImage::Header& header = itk.header();
  ImageFile image;
  image.format = ending->name;
  image.placed = header.placed;
  image.grid.size = header.size;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<Eigen::Index>(axis);
    image.grid.spacing_m[at] = header.spacing_mm[axis] / 1000;
    image.grid.origin_m[at] = header.origin_mm[axis] / 1000;
    image.grid.direction.col(at) = Vector3(header.direction[axis].data());
  }
  // Before memory for the voxels is asked for.
  make_sound(image.grid, what);
  std::vector<std::size_t> not_finite;
  if (nifti) {
    // ITK converts the distances between voxels then, and not where the first one is.
    constexpr int kUnstated = 0, kMillimetres = 2;
    if (nifti->unit() != kUnstated && nifti->unit() != kMillimetres)
      throw Error(what + ": its unit of length is not the millimetre; save it in mm");
    image.placed = nifti->qform().stated() || nifti->sform().stated();
    image.findings = remarks_on_places(*nifti, image.grid, what);
    not_finite = check_nifti(stream, *nifti, file.string(), image.grid.voxels());
  }
  if (ending->format == ImageFormat::kMetaImage) {
    check_meta_image(file.string(), image.grid.voxels() * header.bytes_per_voxel);
  }
  image.values = itk.values();
  for (const std::size_t voxel : not_finite) image.values[voxel] = std::numeric_limits<float>::quiet_NaN();
  return image;
}

}  // namespace kiroku::sim
