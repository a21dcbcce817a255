#include "recorder/source/synthetic_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

extern "C" {
#include <libswscale/swscale.h>

#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include "base/error.h"
#include "base/utc_time.h"
#include "recorder/source/scene_layer.h"
#include "recorder/source/scene_text.h"

namespace kiroku::recorder {
namespace {

/// Sines and cosines of an angle for each column or row. The sine of the sum of a column's and a row's angle
/// is made of them: what bends as waves do costs no sine a pixel.
class Wave {
 public:
  template <typename Angle>
  Wave(int count, const Angle& angle) {
    for (int i = 0; i < count; ++i) {
      const float here = angle(static_cast<float>(i) / static_cast<float>(count));
      sines_.push_back(std::sin(here));
      cosines_.push_back(std::cos(here));
    }
  }
  friend float sine(const Wave& a, int i, const Wave& b, int j) {
    const auto one = static_cast<std::size_t>(i), other = static_cast<std::size_t>(j);
    return a.sines_[one] * b.cosines_[other] + a.cosines_[one] * b.sines_[other];
  }

 private:
  std::vector<float> sines_, cosines_;
};

/// A bell around `middle`, `width` wide, at a share of the way.
float bell(float at, float middle, float width) {
  const float away = (at - middle) / width;
  return std::exp(-away * away);
}

/// The same numbers each time, evenly from -most to most.
class Noise {
 public:
  explicit Noise(float most) : most_(most) {}
  float next() {
    // Xorshift (Marsaglia 2003).
    state_ ^= state_ << 13;
    state_ ^= state_ >> 17;
    state_ ^= state_ << 5;
    constexpr float kSteps = 65'536;
    return most_ * (2 * static_cast<float>(state_ >> 16) / kSteps - 1);
  }

 private:
  const float most_;
  std::uint32_t state_ = 2'463'534'242;
};

Paint brighter(Paint paint, float by) {
  return {std::clamp(paint.red + by, 0.0F, 255.0F), std::clamp(paint.green + by, 0.0F, 255.0F),
          std::clamp(paint.blue + by, 0.0F, 255.0F), paint.alpha};
}

struct Size {
  int width, height;
};

/// Tissue: warm reds with folds (waves bent by each other), fine vessels where two waves cross zero, mottled
/// by blurred noise.
SceneLayer tissue(const Size& size) {
  const Wave fold_x(size.width, [](float x) { return 17 * x; });
  const Wave fold_y(size.height, [](float y) { return 2.3F * std::sin(9 * y); });
  const Wave crease_y(size.height, [](float y) { return 23 * y; });
  const Wave crease_x(size.width, [](float x) { return 1.7F * std::sin(13 * x); });
  const Wave vessel_x(size.width, [](float x) { return 15 * x; });
  const Wave vessel_y(size.height, [](float y) { return 3 * std::sin(6 * y); });
  const Wave branch_y(size.height, [](float y) { return 14 * y; });
  const Wave branch_x(size.width, [](float x) { return 2 * std::sin(5 * x); });
  Noise noise(36);
  Drawing drawing(size.width, size.height, [&](int x, int y) {
    const float fold = sine(fold_x, x, fold_y, y), crease = sine(crease_x, x, crease_y, y);
    const bool vessel = std::abs(sine(vessel_x, x, vessel_y, y) * sine(branch_x, x, branch_y, y)) < 0.025F;
    const Paint paint{186 + 30 * fold + 18 * crease - (vessel ? 60.0F : 0.0F),
                      88 + 24 * fold + 14 * crease - (vessel ? 50.0F : 0.0F), 76 + 20 * fold + 6 * crease};
    return brighter(paint, noise.next());
  });
  for (const int radius : {2, 2, 1}) drawing.luma.blur(radius);
  drawing.blue.blur(1);
  drawing.red.blur(1);
  return SceneLayer(drawing);
}

/// What an endoscope's tip sees of its own light: bright in the middle, black outside the round field.
SceneLayer vignette(const Size& size) {
  const float half = static_cast<float>(size.height) / 2;
  return SceneLayer(
      {size.width, size.height, [&](int x, int y) {
         const float away = std::hypot(static_cast<float>(x) - static_cast<float>(size.width) / 2,
                                       static_cast<float>(y) - half) /
                            half;
         const bool outside = away > 0.97F;
         return Paint{0, 0, 0, outside ? 255 : 255 * std::clamp((away - 0.62F) * 1.1F, 0.0F, 1.0F)};
       }});
}

/// Wet tissue reflects the light in small bright spots.
SceneLayer gloss(const Size& size) {
  const Wave one_x(size.width, [](float x) { return 37 * x; });
  const Wave one_y(size.height, [](float y) { return 5 * std::sin(11 * y); });
  const Wave other_y(size.height, [](float y) { return 31 * y; });
  const Wave other_x(size.width, [](float x) { return 4 * std::sin(17 * x); });
  Drawing drawing(size.width, size.height, [&](int x, int y) {
    const bool spot = sine(one_x, x, one_y, y) * sine(other_x, x, other_y, y) > 0.985F;
    return Paint{255, 250, 245, spot ? 230.0F : 0.0F};
  });
  for (int i = 0; i < 2; ++i) drawing.alpha.blur(1);
  return SceneLayer(drawing);
}

/// From the right: a steel shaft with a lit upper edge, and a tapering jaw.
SceneLayer grasper(const Size& size) {
  constexpr float kJaw = 0.3F;
  return SceneLayer(
      {size.width, size.height, [&](int column, int row) {
         const float x = static_cast<float>(column) / static_cast<float>(size.width),
                     y = static_cast<float>(row) / static_cast<float>(size.height);
         const float wide = static_cast<float>(size.width) / static_cast<float>(size.height);  // of x to y
         const float off = std::abs(y - 0.5F);
         const bool shaft = x > kJaw && off < 0.42F;
         const bool jaw = x <= kJaw && std::abs(off - (kJaw - x) * 0.25F * wide) < 0.06F + 0.26F * x / kJaw;
         return brighter({110, 114, 120, shaft || jaw ? 255.0F : 0.0F}, 120 * bell(y, 0.32F, 0.12F));
       }});
}

class Endoscope : public SyntheticScene {
 public:
  explicit Endoscope(const SceneForm& form)
      : form_(form),
        tissue_(tissue({form.width * 5 / 4 / 2 * 2, form.height * 5 / 4 / 2 * 2})),
        gloss_(gloss({form.width, form.height})),
        grasper_(grasper({form.width / 2 / 2 * 2, std::max(16, form.height / 9 / 2 * 2)})),
        vignette_(vignette({form.width, form.height})) {}

  media::Frame picture(std::int64_t number) override {
    const double t = static_cast<double>(number) / form_.rate, w = form_.width, h = form_.height;
    const auto whole = [](double place) { return static_cast<int>(std::floor(place)); };
    media::Frame picture = new_picture(form_.width, form_.height);
    const double spare_x = form_.width * 5 / 4 / 2 * 2 - w, spare_y = form_.height * 5 / 4 / 2 * 2 - h;
    tissue_.fill(*picture, whole(spare_x / 2 * (1 + 0.8 * std::sin(0.9 * t))),
                 whole(spare_y / 2 * (1 + 0.8 * std::sin(1.7 * t))));
    gloss_.lay_over(*picture, whole(8 * std::sin(1.3 * t)), whole(6 * std::sin(1.7 * t)));
    grasper_.lay_over(*picture, whole(w * (0.46 + 0.07 * std::sin(0.8 * t))),
                      whole(h * (0.52 + 0.10 * std::sin(1.1 * t))));
    vignette_.lay_over(*picture, 0, 0);
    return picture;
  }

 private:
  const SceneForm form_;
  const SceneLayer tissue_, gloss_, grasper_, vignette_;
};

/// Wall and floor, a lamp's glow, a table under a green drape with its shadow.
SceneLayer theatre(const Size& size) {
  Noise noise(6);
  return SceneLayer(
      {size.width, size.height, [&](int column, int row) {
         const float x = static_cast<float>(column) / static_cast<float>(size.width),
                     y = static_cast<float>(row) / static_cast<float>(size.height);
         const bool table = x >= 0.30F && x <= 0.74F && y >= 0.56F && y <= 0.74F;
         Paint paint{30, 104, 96};
         if (!table) paint = y < 0.62F ? brighter({150, 166, 170}, 20 * y) : brighter({96, 104, 108}, 30 * y);
         return brighter(paint, 66 * bell(x, 0.52F, 0.16F) * bell(y, 0.16F, 0.20F) + noise.next());
       }});
}

/// A person in scrubs: head and shoulders.
SceneLayer person(const Size& size) {
  constexpr float kCap = 0.14F, kChin = 0.30F;
  Drawing drawing(size.width, size.height, [&](int column, int row) {
    const float x = static_cast<float>(column) / static_cast<float>(size.width) - 0.5F,
                y = static_cast<float>(row) / static_cast<float>(size.height);
    const bool head = std::hypot(x / 0.24F, (y - 0.16F) / 0.15F) < 1;
    const bool body = std::hypot(x / 0.48F, (y - 0.72F) / 0.46F) < 1;
    Paint paint{52, 112, 118};
    if (y < kChin) paint = {205, 170, 150};
    if (y < kCap) paint = {60, 120, 140};
    paint.alpha = head || body ? 255.0F : 0.0F;
    return paint;
  });
  drawing.luma.blur(1);
  drawing.alpha.blur(1);
  return SceneLayer(drawing);
}

class Room : public SyntheticScene {
 public:
  explicit Room(const SceneForm& form)
      : form_(form),
        dot_(std::max(1, form.height / 144)),
        theatre_(theatre({form.width, form.height})),
        person_(person({std::max(16, form.width / 7 / 2 * 2), std::max(16, form.height / 2 / 2 * 2)})) {}

  media::Frame picture(std::int64_t number) override {
    const double t = static_cast<double>(number) / form_.rate, w = form_.width, h = form_.height;
    const auto whole = [](double place) { return static_cast<int>(std::floor(place)); };
    media::Frame picture = new_picture(form_.width, form_.height);
    theatre_.fill(*picture, 0, 0);
    person_.lay_over(*picture, whole(w * (0.20 + 0.03 * std::sin(0.6 * t))),
                     whole(h * (0.30 + 0.01 * std::sin(2.1 * t))));
    person_.lay_over(*picture, whole(w * (0.64 + 0.05 * std::sin(0.4 * t + 1))), whole(h * 0.28));
    // "2026-08-05T09:15:02.000123Z"
    std::string wall_clock = format_utc(utc_now());
    wall_clock.resize(19);
    wall_clock[10] = ' ';
    write_text(*picture, whole(w * 0.03), whole(h * 0.04), dot_, wall_clock + " UTC", {255, 255, 255});
    const std::int64_t seconds = number / form_.rate;
    char since[64];
    std::snprintf(since, sizeof since, "%02lld:%02lld.%02lld", static_cast<long long>(seconds / 60),
                  static_cast<long long>(seconds % 60), static_cast<long long>(number % form_.rate));
    write_text(*picture, whole(w * 0.03), whole(h * 0.15), dot_, since, {255, 255, 0});
    return picture;
  }

 private:
  const SceneForm form_;
  const int dot_;  // pixels of a character's dot
  const SceneLayer theatre_, person_;
};

/// Pictures of yuv420p in another format of the same size.
class FormatConverter {
 public:
  explicit FormatConverter(int pixel_format) : format_(static_cast<AVPixelFormat>(pixel_format)) {
    if (sws_isSupportedOutput(format_) != 0) return;
    const char* const name = av_get_pix_fmt_name(format_);
    throw Error(std::string("no synthetic pictures can be made in the pixel format '") +
                (name != nullptr ? name : "(unknown)") + "'");
  }
  media::Frame convert(media::Frame picture) {
    if (picture->format == format_) return picture;
    media::Frame converted = media::make_frame();
    media::require(av_frame_copy_props(converted.get(), picture.get()), kAction);
    converted->width = picture->width;
    converted->height = picture->height;
    converted->format = format_;
    // Limited range is a word of luma and chroma.
    const AVPixFmtDescriptor& form = *av_pix_fmt_desc_get(format_);
    if ((form.flags & AV_PIX_FMT_FLAG_RGB) != 0 || form.nb_components < 3)
      converted->color_range = AVCOL_RANGE_UNSPECIFIED;
    media::require(av_frame_get_buffer(converted.get(), 0), kAction);
    // Without these flags the result depends on the processor.
    constexpr int kFlags = SWS_BICUBIC | SWS_ACCURATE_RND | SWS_BITEXACT;
    scaler_.reset(sws_getCachedContext(scaler_.release(), picture->width, picture->height,
                                       static_cast<AVPixelFormat>(picture->format), picture->width,
                                       picture->height, format_, kFlags, nullptr, nullptr, nullptr));
    if (!scaler_) throw std::bad_alloc();
    media::require(sws_scale(scaler_.get(), picture->data, picture->linesize, 0, picture->height,
                             converted->data, converted->linesize),
                   kAction);
    return converted;
  }

 private:
  static constexpr const char* kAction = "cannot make a synthetic picture";
  const AVPixelFormat format_;
  media::Scaler scaler_;
};

class Converted : public SyntheticScene {
 public:
  Converted(std::unique_ptr<SyntheticScene> scene, int pixel_format)
      : scene_(std::move(scene)), converter_(pixel_format) {}
  media::Frame picture(std::int64_t number) override { return converter_.convert(scene_->picture(number)); }

 private:
  const std::unique_ptr<SyntheticScene> scene_;
  FormatConverter converter_;
};

constexpr int kPeriod = 256;  // pixels after which the pattern begins anew

/// Cells of eight colours, each with a slope, a fine grid or a disc in it.
SceneLayer cells(const Size& size) {
  constexpr int kCell = 64, kGrid = 8;
  return SceneLayer({size.width, size.height, [&](int x, int y) {
                       const int column = x / kCell % (kPeriod / kCell), row = y / kCell;
                       const int in_x = x % kCell, in_y = y % kCell;
                       const int number = (column + 3 * row) % 8;
                       const auto part = [&](int bit) { return (number & bit) != 0 ? 210.0F : 40.0F; };
                       const Paint plain{part(1), part(2), part(4)};
                       constexpr float kMiddle = kCell / 2.0F;
                       switch ((column + row) % 3) {
                         case 0:
                           return brighter(plain, static_cast<float>(in_x) - kCell / 2);
                         case 1:
                           return brighter(plain, (in_x / kGrid + in_y / kGrid) % 2 == 0 ? 25.0F : -25.0F);
                         default:
                           return brighter(plain, std::hypot(static_cast<float>(in_x) - kMiddle,
                                                             static_cast<float>(in_y) - kMiddle) < 24
                                                      ? 35.0F
                                                      : 0.0F);
                       }
                     }});
}

class Pattern : public SyntheticScene {
 public:
  explicit Pattern(const SceneForm& form) : form_(form) {
    // Wider than the picture by a strip that it moves in: other pointers, the same pixels.
    const Size size{form.width + kPeriod, form.height};
    media::Frame wide = new_picture(size.width, size.height);
    cells(size).fill(*wide, 0, 0);
    wide_ = FormatConverter(form.pixel_format).convert(std::move(wide));
  }
  media::Frame picture(std::int64_t number) override {
    constexpr std::int64_t kStep = 4;
    media::Frame picture = media::reference(*wide_);
    picture->crop_left = static_cast<std::size_t>(kStep * number % kPeriod);
    picture->crop_right = static_cast<std::size_t>(kPeriod) - picture->crop_left;
    media::require(av_frame_apply_cropping(picture.get(), AV_FRAME_CROP_UNALIGNED),
                   "cannot make a synthetic picture");
    return picture;
  }

 private:
  const SceneForm form_;
  media::Frame wide_;
};

}  // namespace

std::unique_ptr<SyntheticScene> make_scene(std::string_view name, const SceneForm& form) {
  if (name == "pattern") return std::make_unique<Pattern>(form);
  std::unique_ptr<SyntheticScene> scene;
  if (name == "endoscope") scene = std::make_unique<Endoscope>(form);
  if (name == "room") scene = std::make_unique<Room>(form);
  if (!scene || form.pixel_format == AV_PIX_FMT_YUV420P) return scene;
  return std::make_unique<Converted>(std::move(scene), form.pixel_format);
}

media::Frame white_picture(const SceneForm& form) {
  media::Frame picture = new_picture(form.width, form.height);
  SceneLayer({form.width, form.height, [](int, int) { return Paint{255, 255, 255}; }}).fill(*picture, 0, 0);
  return FormatConverter(form.pixel_format).convert(std::move(picture));
}

}  // namespace kiroku::recorder
