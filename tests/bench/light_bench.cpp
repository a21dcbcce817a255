// How well the codes of a display (light/) are read in pictures of a room: shares of seconds by the height of
// the code, after MPEG-2 of 4 Mbit/s by the recorder's own encoder; and false readings in films that show
// none.
//   light_bench [SECONDS=40] [HEIGHT] [CONDITION]   what is read, of so many seconds for each condition
//   light_bench --false PICTURES SEED FILM...       false readings in pictures of films, each cut out in
//                                                   another way by the seed, with a place where a display was
//                                                   thought to be; tests/bench/light.sh runs it on all cores
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

extern "C" {
#include <libswscale/swscale.h>

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/frame.h>
#include <libavutil/pixfmt.h>
}

#include "archive/format/ledger_entry.h"
#include "light/ledger_lights.h"
#include "light/light_code.h"
#include "light/light_judge.h"
#include "light/light_picture.h"
#include "light/picture_finder.h"
#include "media/libav_handles.h"
#include "recorder/encoder/video_encoder.h"
#include "recorder/source/source.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

constexpr int kWidth = 1920, kHeight = 1080, kRate = 25;
constexpr std::int64_t kBegin = 1'790'000'000;  // Unix time
constexpr std::int64_t kSecond = 1'000'000'000;

/// A ledger that writes two entries a second.
light::LedgerLights ledger_of(int seconds) {
  light::LedgerLights ledger;
  for (int i = 0; i < 2 * (seconds + 10); ++i) {
    archive::CaseEntry entry;
    entry.seq = static_cast<std::uint64_t>(i);
    entry.at = {UtcTime(std::chrono::microseconds(kBegin * 1'000'000 + i * 500'000)), i * kSecond / 2};
    entry.body = archive::ClockEntry{true, i, 0, 0, 0};
    ledger.add_line(archive::to_line(entry));
  }
  ledger.finish();
  return ledger;
}

/// What a display shows in a second: made of the newest entry that it has seen.
std::uint64_t shown_in(const light::LedgerLights& ledger, std::int64_t second) {
  const auto codes = ledger.codes_of(second, second);
  std::uint64_t code = 0, entries = 0;
  for (const light::LedgerCode& one : codes) {
    if (one.entries <= entries || one.entries > 2 * static_cast<std::uint64_t>(second - kBegin) + 1) continue;
    code = one.code;
    entries = one.entries;
  }
  return code;
}

struct Condition {
  const char* name = "";
  double blur = 0.7;     // of the lens, standard deviation in pixels
  double glare = 0;      // added by a lamp's reflection over one end of the code
  bool covered = false;  // a half, another one each second
  double turn = 0;       // degrees
  double narrow = 1;     // seen from the side
  double noise = 2;      // of the sensor, standard deviation
};

class Scene {
 public:
  Scene(const Condition& condition, double height) : condition_(condition), height_(height) {}

  /// Draws the display into luma, with what is before it.
  void draw(std::uint8_t* luma, std::ptrdiff_t stride, std::uint64_t code, std::int64_t second) {
    constexpr double kDark = 26, kBright = 190;
    const double frame_rows = light::kRows + 2, frame_columns = light::kColumns + 2;
    const double cell = height_ / frame_rows;
    const double reach = 12 * cell + 6 * condition_.blur + 4;
    const double x0 = kWidth * 0.78 + 0.37, y0 = kHeight * 0.3 + 0.21;
    const int left = static_cast<int>(x0 - reach), top = static_cast<int>(y0 - reach);
    const int size = static_cast<int>(2 * reach);
    std::vector<float> patch(static_cast<std::size_t>(size) * static_cast<std::size_t>(size));
    const double angle = condition_.turn * 3.14159265 / 180;
    constexpr int kFine = 4;
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        double sum = 0;
        for (int i = 0; i < kFine * kFine; ++i) {
          const double px = left + x + (i % kFine + 0.5) / kFine - 0.5 - x0;
          const double py = top + y + (i / kFine + 0.5) / kFine - 0.5 - y0;
          // In cells from the code's centre.
          const double u = (px * std::cos(angle) + py * std::sin(angle)) / (cell * condition_.narrow);
          const double v = (py * std::cos(angle) - px * std::sin(angle)) / cell;
          const double column = u + light::kPictureColumns / 2.0, row = v + light::kPictureRows / 2.0;
          double value = luma[(top + y) * stride + left + x];
          if (column >= 0 && row >= 0 && column < light::kPictureColumns && row < light::kPictureRows) {
            value = lit(code, static_cast<int>(row), static_cast<int>(column)) ? kBright : kDark;
            if (condition_.glare > 0) {
              const double far = std::hypot(u - frame_columns / 3, v + frame_rows / 4) / (frame_rows / 2);
              value += condition_.glare * std::exp(-far * far);
            }
          }
          if (condition_.covered && is_covered(u / frame_columns, v / frame_rows, second))
            value = 90 + 25 * std::sin(px * 0.31 + static_cast<double>(second)) + 20 * std::sin(py * 0.23);
          sum += std::min(value, 235.0);
        }
        patch[static_cast<std::size_t>(y * size + x)] = static_cast<float>(sum / (kFine * kFine));
      }
    }
    blur(patch, size);
    for (int y = 0; y < size; ++y)
      for (int x = 0; x < size; ++x)
        luma[(top + y) * stride + left + x] = static_cast<std::uint8_t>(
            std::clamp(patch[static_cast<std::size_t>(y * size + x)] + 0.5F, 0.0F, 255.0F));
  }

  void add_noise(std::uint8_t* luma, std::ptrdiff_t stride) {
    // The same for each run, and another for each picture.
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        std::uint8_t& value = luma[y * stride + x];
        value = static_cast<std::uint8_t>(std::clamp(value + noise_[random_() % noise_.size()], 0, 255));
      }
    }
  }
  void prepare_noise() {
    std::normal_distribution<double> normal(0, condition_.noise);
    for (int& one : noise_) one = static_cast<int>(std::lround(normal(random_)));
  }

 private:
  static bool lit(std::uint64_t code, int row, int column) {
    const int from_edge =
        std::min({row, column, light::kPictureRows - 1 - row, light::kPictureColumns - 1 - column});
    if (from_edge == 0) return false;
    return from_edge == 1 || light::is_bright(code, row - 2, column - 2);
  }
  /// `across` and `down` in shares of the code.
  static bool is_covered(double across, double down, std::int64_t second) {
    constexpr double kFar = 0.75;
    if (std::abs(across) > kFar || std::abs(down) > kFar) return false;
    switch (second % 6) {
      case 0:
        return across > 0;
      case 1:
        return across < 0;
      case 2:
        return down > 0;
      case 3:
        return down < 0;
      case 4:
        return across + down > 0;
      default:
        return across < down;
    }
  }
  void blur(std::vector<float>& patch, int size) const {
    if (condition_.blur <= 0) return;
    const int radius = static_cast<int>(std::ceil(3 * condition_.blur));
    std::vector<float> weights;
    float all = 0;
    for (int i = -radius; i <= radius; ++i) {
      weights.push_back(static_cast<float>(std::exp(-i * i / (2 * condition_.blur * condition_.blur))));
      all += weights.back();
    }
    for (const bool down : {false, true}) {
      std::vector<float> from = patch;
      for (int y = 0; y < size; ++y) {
        for (int x = 0; x < size; ++x) {
          float sum = 0;
          for (int i = -radius; i <= radius; ++i) {
            const int at_x = std::clamp(down ? x : x + i, 0, size - 1);
            const int at_y = std::clamp(down ? y + i : y, 0, size - 1);
            sum += from[static_cast<std::size_t>(at_y * size + at_x)] *
                   weights[static_cast<std::size_t>(i + radius)];
          }
          patch[static_cast<std::size_t>(y * size + x)] = sum / all;
        }
      }
    }
  }

  Condition condition_;
  double height_;
  std::mt19937 random_{7};
  std::array<int, 4096> noise_{};
};

/// Decodes what the encoder gives, one picture for each packet.
class Decoder {
 public:
  explicit Decoder(const AVCodecContext& encoder)
      : codec_(avcodec_alloc_context3(avcodec_find_decoder(encoder.codec_id))) {
    codec_->flags |= AV_CODEC_FLAG_LOW_DELAY;
    media::require(avcodec_open2(codec_.get(), nullptr, nullptr), "cannot decode");
  }
  bool decode(const AVPacket* packet, AVFrame& frame) {
    media::require(avcodec_send_packet(codec_.get(), packet), "cannot decode");
    return avcodec_receive_frame(codec_.get(), &frame) >= 0;
  }

 private:
  media::Codec codec_;
};

light::LightReport run(const Condition& condition, double height, int seconds,
                       std::vector<media::Frame>& room) {
  const light::LedgerLights ledger = ledger_of(seconds);
  light::LightJudge judge(ledger);
  Scene scene(condition, height);
  scene.prepare_noise();
  recorder::VideoProfile profile;
  recorder::PictureFormat format;
  format.width = kWidth;
  format.height = kHeight;
  format.pixel_format = AV_PIX_FMT_YUV420P;
  recorder::VideoEncoder encoder(format, {kRate, 1}, profile);
  Decoder decoder(*encoder.muxed_stream().encoder);
  light::PictureFinder finder;
  const media::Frame decoded = media::make_frame();
  int count = 0;
  const auto look = [&] {
    const light::GreyView view{decoded->data[0], decoded->width, decoded->height, decoded->linesize[0]};
    if (count % 10 == 0) finder.search(view);
    judge.add(count * kSecond / kRate, finder.read(view));
    ++count;
  };
  for (int i = 0; i < seconds * kRate; ++i) {
    media::Frame frame(av_frame_clone(room[static_cast<std::size_t>(i) % room.size()].get()));
    media::require(av_frame_make_writable(frame.get()), "cannot draw");
    // The display is seen a tenth of a second late.
    const std::int64_t second = kBegin + std::max<std::int64_t>((i - 2), 0) / kRate;
    // For the first three seconds nothing is before it: a display is found before it is covered.
    Condition now = condition;
    now.covered = condition.covered && i >= 3 * kRate;
    Scene drawn(now, height);
    drawn.draw(frame->data[0], frame->linesize[0], shown_in(ledger, second), second);
    scene.add_noise(frame->data[0], frame->linesize[0]);
    const std::int64_t time = i * kSecond / kRate;
    media::Frame prepared = encoder.prepare(std::move(frame), time);
    if (!prepared) continue;
    const media::Packet packet = encoder.encode(std::move(prepared), i % (2 * kRate) == 0);
    if (decoder.decode(packet.get(), *decoded)) look();
  }
  if (decoder.decode(nullptr, *decoded)) look();
  return judge.finish();
}

int read_rates(int seconds, double only_height, const std::string& only) {
  recorder::CaseClock clock;
  const auto source = recorder::open_source(
      recorder::parse_source_address("synthetic:room?size=1920x1080&rate=25&speed=max"), clock);
  std::vector<media::Frame> room;
  for (int i = 0; i < 2 * kRate; ++i) {
    auto timed = source->read();
    room.push_back(std::move(timed->frame));
  }
  const std::array<Condition, 6> conditions{
      {{.name = "plain"},
       {.name = "blur", .blur = 1.5},
       {.name = "glare", .glare = 160},
       {.name = "half covered", .covered = true},
       {.name = "turned by 12 degrees, from the side", .turn = 12, .narrow = 0.8},
       {.name = "noise", .noise = 6}}};
  std::printf("%-38s %8s %8s %8s %8s %8s\n", "condition", "height", "seconds", "agree", "unread", "wrong");
  for (const double height : {21.6, 30.0, 40.0}) {
    if (only_height > 0 && height != only_height) continue;
    for (const Condition& condition : conditions) {
      if (!only.empty() && only != condition.name) continue;
      const light::LightReport report = run(condition, height, seconds, room);
      std::printf("%-38s %8.1f %8lu %7.1f%% %8lu %8lu\n", condition.name, height, report.seconds,
                  100.0 * static_cast<double>(report.agreeing) / static_cast<double>(report.seconds),
                  report.unread, report.old + report.foreign);
      std::fflush(stdout);
    }
  }
  return 0;
}

int false_readings(int pictures, unsigned seed, const std::vector<std::string>& films) {
  const light::LedgerLights ledger = ledger_of(pictures / kRate + 1);
  light::LightJudge judge(ledger);
  std::mt19937 random(seed);
  recorder::CaseClock clock;
  std::uint64_t places = 0;
  for (int count = 0; count < pictures;) {
    for (const std::string& film : films) {
      const auto source = recorder::open_source(recorder::parse_source_address(film + "?speed=max"), clock);
      // Another part of the picture for each second, so that no second is the same twice.
      int left = 0, top = 0;
      light::PictureFinder finder;
      while (count < pictures) {
        const auto timed = source->read();
        if (!timed) break;
        if (timed->is_sound) continue;
        const AVFrame& frame = *timed->frame;
        if (count % kRate == 0) {
          left = static_cast<int>(random() % static_cast<unsigned>(frame.width / 3));
          top = static_cast<int>(random() % static_cast<unsigned>(frame.height / 3));
          std::uniform_real_distribution<double> share(0, 1);
          const double x = 40 + 200 * share(random), y = 40 + 100 * share(random);
          const double height = 20 + 30 * share(random), width = height * 16 / 9;
          const light::Place place{
              light::Point{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}};
          finder = light::PictureFinder(std::span(&place, 1));
        }
        const light::GreyView view{frame.data[0] + top * frame.linesize[0] + left, frame.width - left,
                                   frame.height - top, frame.linesize[0]};
        if (count % 5 == 0) {
          const std::size_t before = finder.places().size();
          finder.search(view);
          places += finder.places().size() - std::min(before, finder.places().size());
        }
        judge.add(count * kSecond / kRate, finder.read(view));
        ++count;
      }
    }
  }
  const light::LightReport report = judge.finish();
  std::printf(
      "pictures %lu, seconds %lu, places that looked like a code %lu, false readings: agree %lu, old %lu, "
      "foreign %lu\n",
      report.pictures, report.seconds, places, report.agreeing, report.old, report.foreign);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    media::silence_libav();
    if (argc > 4 && argv[1] == std::string("--false"))
      return false_readings(std::stoi(argv[2]), static_cast<unsigned>(std::stoul(argv[3])),
                            {argv + 4, argv + argc});
    return read_rates(argc > 1 ? std::stoi(argv[1]) : 40, argc > 2 ? std::stod(argv[2]) : 0,
                      argc > 3 ? argv[3] : "");
  } catch (const std::exception& error) {
    std::cerr << "light_bench: " << error.what() << "\n";
    return 2;
  }
}
