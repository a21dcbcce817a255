#include "apps/sim/radiograph_series.h"

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "base/error.h"
#include "recorder/quality/clip.h"
#include "sim/drr/dicom_radiograph.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr double kUsualRate = 10, kNsPerS = 1e9;

void turn_black_white(sim::ProjectionImage& image) {
  if (image.values.empty()) return;
  const float most = *std::ranges::max_element(image.values);
  for (float& value : image.values) value = most - value;
}

std::optional<sim::Polarity> stated(const std::optional<std::string>& polarity) {
  if (!polarity) return std::nullopt;
  return *polarity == "bone-black" ? sim::Polarity::kBoneBlack : sim::Polarity::kBoneWhite;
}

class Folder : public RadiographSeries {
 public:
  Folder(const fs::path& folder, std::optional<std::string> polarity, double a_second)
      : polarity_(std::move(polarity)), a_second_(a_second) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      const std::string ending = entry.path().extension().string();
      if (!entry.is_regular_file()) continue;
      if (ending == ".png" || ending == ".mha" || sim::is_dicom_file(entry.path()))
        files_.push_back(entry.path());
    }
    if (files_.empty())
      throw UsageError("--radiographs is '" + folder.string() +
                       "', where there is no .png, .mha or DICOM file");
    std::ranges::sort(files_);
  }
  std::optional<TimedRadiograph> next() override {
    if (given_ == files_.size()) return std::nullopt;
    const fs::path& file = files_[given_];
    const double time_s = static_cast<double>(given_++) / a_second_;
    return TimedRadiograph{time_s, read_radiograph(file, polarity_), file.filename().string()};
  }
  [[nodiscard]] std::optional<std::size_t> count() const override { return files_.size(); }

 private:
  const std::optional<std::string> polarity_;
  const double a_second_;
  std::vector<fs::path> files_;
  std::size_t given_ = 0;
};

class MultiFrame : public RadiographSeries {
 public:
  MultiFrame(const fs::path& file, const std::optional<std::string>& polarity, std::optional<double> a_second)
      : file_(file.filename().string()), read_(sim::read_dicom_radiographs(file, stated(polarity))) {
    if (a_second) {
      read_.times_s.resize(read_.images.size());
      for (std::size_t i = 0; i < read_.times_s.size(); ++i)
        read_.times_s[i] = static_cast<double>(i) / *a_second;
    }
    if (read_.times_s.empty()) {
      throw UsageError("'" + file.string() + "' does not say when its " +
                       std::to_string(read_.images.size()) +
                       " pictures were taken: give --rate, pictures a second");
    }
  }
  std::optional<TimedRadiograph> next() override {
    if (given_ == read_.images.size()) return std::nullopt;
    const std::size_t at = given_++;
    return TimedRadiograph{read_.times_s[at], std::move(read_.images[at]),
                           file_ + ", picture " + std::to_string(at + 1)};
  }
  [[nodiscard]] std::optional<std::size_t> count() const override { return read_.images.size(); }

 private:
  const std::string file_;
  sim::DicomRadiographs read_;
  std::size_t given_ = 0;
};

/// The brightness of a film's pictures.
class Film : public RadiographSeries {
 public:
  Film(const fs::path& file, const std::optional<std::string>& polarity, std::optional<double> a_second)
      : file_(file.filename().string()),
        black_(polarity == "bone-black"),
        a_second_(a_second),
        clip_(file, {}) {}
  std::optional<TimedRadiograph> next() override {
    const media::Frame frame = clip_.next();
    if (!frame) return std::nullopt;
    if (given_ == 0) first_ns_ = frame->pts;
    TimedRadiograph radiograph{static_cast<double>(frame->pts - first_ns_) / kNsPerS, brightness(*frame),
                               file_ + ", picture " + std::to_string(given_ + 1)};
    if (a_second_) radiograph.time_s = static_cast<double>(given_) / *a_second_;
    ++given_;
    if (black_) turn_black_white(radiograph.image);
    return radiograph;
  }
  [[nodiscard]] std::optional<std::size_t> count() const override { return std::nullopt; }

 private:
  [[nodiscard]] sim::ProjectionImage brightness(const AVFrame& frame) const {
    sim::ProjectionImage image{
        static_cast<std::size_t>(frame.width), static_cast<std::size_t>(frame.height), {}};
    image.values.reserve(image.columns * image.rows);
    const bool wide = clip_.depth() > 8;
    for (std::size_t row = 0; row < image.rows; ++row) {
      const std::uint8_t* const line = frame.data[0] + std::ptrdiff_t(row) * frame.linesize[0];
      for (std::size_t column = 0; column < image.columns; ++column) {
        std::uint16_t value = line[column];
        if (wide) std::memcpy(&value, line + 2 * column, sizeof value);
        image.values.push_back(static_cast<float>(value));
      }
    }
    return image;
  }

  const std::string file_;
  const bool black_;
  const std::optional<double> a_second_;
  recorder::Clip clip_;
  std::size_t given_ = 0;
  std::int64_t first_ns_ = 0;
};

}  // namespace

sim::ProjectionImage read_radiograph(const fs::path& file, const std::optional<std::string>& polarity) {
  if (sim::is_dicom_file(file)) return sim::read_dicom_radiograph(file, stated(polarity));
  sim::ProjectionImage image;
  if (file.extension() == ".png") {
    const sim::GreyPicture picture = sim::read_png(file);
    image = {picture.columns, picture.rows, {}};
    // As line integrals are, of some units.
    constexpr float kScale = 5.0F / 65535;
    for (const std::uint16_t grey : picture.values) image.values.push_back(kScale * static_cast<float>(grey));
  } else {
    image = sim::read_mha(file);
  }
  if (polarity == "bone-black") turn_black_white(image);
  return image;
}

std::unique_ptr<RadiographSeries> open_radiographs(const fs::path& path,
                                                   const std::optional<std::string>& polarity,
                                                   std::optional<double> a_second) {
  if (fs::is_directory(path)) return std::make_unique<Folder>(path, polarity, a_second.value_or(kUsualRate));
  if (!fs::exists(path)) throw UsageError("--radiographs is '" + path.string() + "', which is not there");
  if (sim::is_dicom_file(path)) return std::make_unique<MultiFrame>(path, polarity, a_second);
  return std::make_unique<Film>(path, polarity, a_second);
}

}  // namespace kiroku::apps
