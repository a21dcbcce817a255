// Pictures of radiographs: grey from line integrals, and PNG files. Functions are pure but for the file that
// is read, and thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "sim/drr/ct_projector.h"

namespace kiroku::sim {

struct GreyPicture {
  std::size_t columns = 0, rows = 0;
  std::vector<std::uint16_t> values;  // (rows x columns), 0 black
};
struct ColourPicture {
  std::size_t columns = 0, rows = 0;
  std::vector<std::array<std::uint8_t, 3>> pixels;  // (rows x columns), red, green, blue
};

/// What is the grey of a line integral p.
enum class Response {
  kTransmission,  // exp(-p), the part of the rays that arrives (Beer and Lambert)
  kFilm,          // p itself, as a film blackens with the logarithm of its exposure
};
enum class Polarity {
  kBoneWhite,  // a film's negative, what attenuates is light
  kBoneBlack,  // a fluoroscope
};
/// The interval of the response that is shown.
struct Window {
  double low = 0, high = 1;
};
/// From the half to 99.5 % of what meets the patient (p > 0.05), of everything where nothing does.
Window window_of(const ProjectionImage& image, Response response);
/// kiroku::Error for a window that is empty or not finite.
GreyPicture picture_of(const ProjectionImage& image, Response response, Window window, Polarity polarity);

/// A PNG file, 16 bits of grey or 8 bits of each colour; the same bytes each time.
Bytes png_of(const GreyPicture& picture);
Bytes png_of(const ColourPicture& picture);
/// Of any depth; colours become their luminance, transparency is left out. kiroku::Error for what is damaged,
/// cut off or no PNG, kiroku::IoError.
GreyPicture read_png(const std::filesystem::path& file);

/// A MetaImage file of floats: one slice, so that every reader of volumes opens it; pixels of this size, or 1
/// x 1.
std::string mha_of(const ProjectionImage& image, const std::optional<std::array<double, 2>>& pixel_mm);
/// The other way round: kiroku::Error for a file of several slices, and of read_image_file().
ProjectionImage read_mha(const std::filesystem::path& file);

}  // namespace kiroku::sim
