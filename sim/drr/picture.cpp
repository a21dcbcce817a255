#include "sim/drr/picture.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <png.h>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/volume/image_file.h"

namespace kiroku::sim {
namespace {

/// Less is air beside the patient.
constexpr double kLeastOfPatient = 0.05;
constexpr double kMostGrey = 65535;
/// As large as detectors are, so that a forged header does not ask for all memory.
constexpr png_uint_32 kMostSide = 32768;

double responded(double integral, Response response) {
  return response == Response::kTransmission ? std::exp(-integral) : integral;
}

/// libpng leaves by longjmp; what it said is kept for the error that is thrown behind it.
struct PngFailure {
  std::string sentence;
};
[[noreturn]] void fail_png(png_structp png, png_const_charp sentence) {
  static_cast<PngFailure*>(png_get_error_ptr(png))->sentence = sentence;
  png_longjmp(png, 1);
}
void ignore_warning(png_structp /*png*/, png_const_charp /*sentence*/) {}

void append_bytes(png_structp png, png_bytep data, png_size_t size) {
  auto& bytes = *static_cast<Bytes*>(png_get_io_ptr(png));
  append(bytes, std::as_bytes(std::span(data, size)));
}
void flush_nothing(png_structp /*png*/) {}

/// Everything that libpng may jump out of is in here, and nothing in here has a destructor.
bool write_rows(png_structp png, png_infop info, Bytes& to, png_uint_32 columns, png_uint_32 rows, int depth,
                int colour_type, const png_byte* const* row_pointers) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_write_fn(png, &to, &append_bytes, &flush_nothing);
  png_set_IHDR(png, info, columns, rows, depth, colour_type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  if (depth == 16 && std::endian::native == std::endian::little) png_set_swap(png);
  for (png_uint_32 row = 0; row < rows; ++row) png_write_row(png, row_pointers[row]);
  png_write_end(png, info);
  return true;
}

Bytes png_of(std::size_t columns, std::size_t rows, int depth, int colour_type, const void* samples) {
  const std::size_t row_bytes = columns * (colour_type == PNG_COLOR_TYPE_RGB ? 3U : 1U) * unsigned(depth) / 8;
  if (columns == 0 || rows == 0 || columns > kMostSide || rows > kMostSide) {
    throw Error("a picture of " + std::to_string(columns) + " x " + std::to_string(rows) +
                " pixels cannot be written as PNG");
  }
  std::vector<const png_byte*> row_pointers;
  for (std::size_t row = 0; row < rows; ++row) {
    row_pointers.push_back(static_cast<const png_byte*>(samples) + row * row_bytes);
  }
  PngFailure failure;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &failure, &fail_png, &ignore_warning);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  Bytes bytes;
  const bool written =
      info != nullptr && write_rows(png, info, bytes, static_cast<png_uint_32>(columns),
                                    static_cast<png_uint_32>(rows), depth, colour_type, row_pointers.data());
  png_destroy_write_struct(&png, &info);
  if (!written) throw Error("cannot write a PNG picture: " + failure.sentence);
  return bytes;
}

struct PngHeader {
  png_uint_32 columns = 0, rows = 0;
};
bool read_header(png_structp png, png_infop info, std::FILE* file, PngHeader& header) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_init_io(png, file);
  png_set_user_limits(png, kMostSide, kMostSide);
  png_read_info(png, info);
  header = {png_get_image_width(png, info), png_get_image_height(png, info)};
  // All kinds become 16 bits of grey without transparency.
  png_set_expand_16(png);
  const int colour_type = png_get_color_type(png, info);
  if ((colour_type & PNG_COLOR_MASK_COLOR) != 0) png_set_rgb_to_gray(png, PNG_ERROR_ACTION_NONE, -1, -1);
  png_set_strip_alpha(png);
  if (std::endian::native == std::endian::little) png_set_swap(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  if (png_get_rowbytes(png, info) != png_size_t{2} * header.columns) png_error(png, "its depth is unknown");
  return true;
}
bool read_rows(png_structp png, png_infop info, png_byte** row_pointers) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_read_image(png, row_pointers);
  png_read_end(png, info);
  return true;
}

}  // namespace

Window window_of(const ProjectionImage& image, Response response) {
  std::vector<float> of_patient;
  for (const float value : image.values) {
    if (double(value) > kLeastOfPatient) of_patient.push_back(value);
  }
  if (of_patient.empty()) of_patient = image.values;
  if (of_patient.empty()) return {};
  const auto at = [&](double part) {
    const auto number = static_cast<std::ptrdiff_t>(part * double(of_patient.size() - 1));
    std::nth_element(of_patient.begin(), of_patient.begin() + number, of_patient.end());
    return responded(double(of_patient[static_cast<std::size_t>(number)]), response);
  };
  const double one = at(0.005), other = at(0.995);
  Window window{std::min(one, other), std::max(one, other)};
  if (!(window.high > window.low)) window.high = window.low + 1;
  return window;
}

GreyPicture picture_of(const ProjectionImage& image, Response response, Window window, Polarity polarity) {
  if (!(window.high > window.low) || !std::isfinite(window.low) || !std::isfinite(window.high)) {
    throw Error("the window from " + number_text(window.low) + " to " + number_text(window.high) +
                " is empty; the second number must be greater");
  }
  GreyPicture picture{image.columns, image.rows, {}};
  picture.values.reserve(image.values.size());
  // Both responses in this sense: where does more attenuation lie?
  const bool invert = (response == Response::kTransmission) == (polarity == Polarity::kBoneWhite);
  for (const float value : image.values) {
    double grey =
        std::clamp((responded(double(value), response) - window.low) / (window.high - window.low), 0.0, 1.0);
    if (invert) grey = 1 - grey;
    picture.values.push_back(static_cast<std::uint16_t>(std::lround(grey * kMostGrey)));
  }
  return picture;
}

Bytes png_of(const GreyPicture& picture) {
  return png_of(picture.columns, picture.rows, 16, PNG_COLOR_TYPE_GRAY, picture.values.data());
}
Bytes png_of(const ColourPicture& picture) {
  return png_of(picture.columns, picture.rows, 8, PNG_COLOR_TYPE_RGB, picture.pixels.data());
}

GreyPicture read_png(const std::filesystem::path& file) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> in(std::fopen(file.c_str(), "rb"), &std::fclose);
  if (!in) throw IoError("read", file, errno);
  PngFailure failure;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &failure, &fail_png, &ignore_warning);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  PngHeader header;
  GreyPicture picture;
  std::vector<png_byte*> rows;
  bool read = info != nullptr && read_header(png, info, in.get(), header);
  if (read) {
    picture = {header.columns, header.rows, {}};
    picture.values.resize(picture.columns * picture.rows);
    for (std::size_t row = 0; row < picture.rows; ++row) {
      rows.push_back(reinterpret_cast<png_byte*>(&picture.values[row * picture.columns]));
    }
    read = read_rows(png, info, rows.data());
  }
  png_destroy_read_struct(&png, &info, nullptr);
  if (!read) {
    throw Error("cannot read " + file.string() + ": it is damaged, cut off or no PNG picture (" +
                failure.sentence + ")");
  }
  return picture;
}

std::string mha_of(const ProjectionImage& image, const std::optional<std::array<double, 2>>& pixel_mm) {
  static_assert(std::endian::native == std::endian::little, "the header says so");
  const std::array<double, 2> spacing = pixel_mm.value_or(std::array<double, 2>{1, 1});
  std::string text =
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = "
      "False\n"
      "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nElementSpacing = " +
      number_text(spacing[0], 17) + " " + number_text(spacing[1], 17) +
      " 1\nDimSize = " + std::to_string(image.columns) + " " + std::to_string(image.rows) +
      " 1\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n";
  text.append(reinterpret_cast<const char*>(image.values.data()), image.values.size() * sizeof(float));
  return text;
}

ProjectionImage read_mha(const std::filesystem::path& file) {
  ImageFile image = read_image_file(file);
  if (image.grid.size[2] != 1) {
    throw Error("cannot use " + file.string() + ": it has " + std::to_string(image.grid.size[2]) +
                " slices; a radiograph has one");
  }
  for (const float value : image.values) {
    if (!std::isfinite(value)) throw Error("cannot use " + file.string() + ": a pixel is no finite number");
  }
  return {image.grid.size[0], image.grid.size[1], std::move(image.values)};
}

}  // namespace kiroku::sim
