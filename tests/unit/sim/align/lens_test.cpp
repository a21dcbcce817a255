#include "sim/render/lens.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <opencv2/calib3d.hpp>

#include <gmock/gmock.h>

#include "base/error.h"
#include "sim/align/lens_file.h"
#include "sim/align/lens_pictures.h"
#include "tests/support/barrel_lens.h"

namespace kiroku::sim {
namespace {

using Eigen::Vector2d;
using testing::HasSubstr;

/// Every coefficient counts, and the axis is not in the middle.
LensCalibration brown() {
  LensCalibration lens;
  lens.width = 640;
  lens.height = 480;
  lens.focal_px = {430, 436};
  lens.middle_px = {331.5, 226};
  lens.coefficients = {-0.28, 0.09, 0.0011, -0.0016, -0.012};
  return lens;
}

LensCalibration fisheye() {
  LensCalibration lens = brown();
  lens.model = LensModel::kFisheye;
  lens.coefficients = {-0.021, 0.006, -0.004, 0.0007, 0};
  return lens;
}

Vector2d shown_by_opencv(const LensCalibration& lens, const Vector2d& plane) {
  const cv::Matx33d camera(lens.focal_px.x(), 0, lens.middle_px.x(), 0, lens.focal_px.y(), lens.middle_px.y(),
                           0, 0, 1);
  const std::vector<cv::Point3d> places{{plane.x(), plane.y(), 1}};
  const auto& k = lens.coefficients;
  const cv::Vec3d none(0, 0, 0);
  std::vector<cv::Point2d> pixels;
  if (lens.model == LensModel::kFisheye)
    cv::fisheye::projectPoints(places, pixels, none, none, camera, cv::Vec4d(k[0], k[1], k[2], k[3]));
  else
    cv::projectPoints(places, none, none, camera, std::vector<double>(k.begin(), k.end()), pixels);
  return {pixels[0].x, pixels[0].y};
}

std::string refusal(const LensCalibration& calibration) {
  try {
    const Lens lens(calibration);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "taken";
}

std::string refusal(const std::string& text) {
  try {
    (void)read_lens_calibration(text, "lens.yml");
  } catch (const UsageError& error) {
    return error.what();
  }
  return "taken";
}

TEST(Lens, ShowsEachPlaceWhereOpenCvDoesAndFindsItBack) {
  for (const LensCalibration& calibration : {brown(), fisheye()}) {
    const Lens lens(calibration);
    for (double y = -0.5; y <= 479.5; y += 5) {
      for (double x = -0.5; x <= 639.5; x += 5) {
        const Vector2d plane = lens.plane_of({x, y});
        ASSERT_LE(plane.norm(), lens.reach() + 1e-12);
        const Vector2d back = shown_by_opencv(calibration, plane);
        ASSERT_LT((back - Vector2d(x, y)).norm(), 1e-6) << name_of(calibration.model) << " " << x << " " << y;
        ASSERT_LT((lens.pixel_of(plane) - back).norm(), 1e-6);
      }
    }
  }
}

TEST(Lens, ShowsPlacesWhereThePageDoes) {
  // As of tests/unit/viewer/web/organ.test.ts.
  EXPECT_LT((Lens(brown()).pixel_of({0.5, -0.3}) - Vector2d(527.44763568, 106.8116803584)).norm(), 1e-9);
  EXPECT_LT((Lens(fisheye()).pixel_of({0.5, -0.3}) - Vector2d(525.0826826249761, 108.22969819838663)).norm(),
            1e-9);
}

TEST(Lens, ShowsNothingBeyondItsReachWithinThePicture) {
  // Its polynomial comes back to the middle further out.
  for (const LensCalibration& calibration : {brown(), fisheye()}) {
    const Lens lens(calibration);
    for (double angle = 0; angle < 6.3; angle += 0.1) {
      double before = 0;
      for (double radius = 1.01; radius < 20; radius *= 1.1) {
        const Vector2d pixel =
            lens.pixel_of(lens.reach() * radius * Vector2d(std::cos(angle), std::sin(angle)));
        const Vector2d share = pixel.cwiseQuotient(Vector2d(640, 480));
        ASSERT_TRUE(share.minCoeff() < 0 || share.maxCoeff() > 1) << angle << " " << radius;
        const double away = (pixel - calibration.middle_px).norm();
        ASSERT_GT(away, before);
        before = away;
      }
    }
  }
}

TEST(Lens, OfABarrelIsAsTheBarrelSays) {
  const test::BarrelLens barrel = test::BarrelLens::of_corners(0.15);
  const Lens lens(barrel.calibration(60));
  const Pinhole straight = pinhole_of(60, 640, 480);
  for (double y = 0; y < 480; y += 7) {
    for (double x = 0; x < 640; x += 7) {
      const Vector2d at = barrel.straight({x, y});
      const Vector2d plane((at.x() - straight.middle_x) / straight.focal_px,
                           (at.y() - straight.middle_y) / straight.focal_px);
      ASSERT_LT((lens.pixel_of(plane) - Vector2d(x, y)).norm(), 0.1) << x << " " << y;
    }
  }
  EXPECT_NEAR(lens.drawn_in(), 1 - 1 / 1.15, 0.003);
  // The middle of the nearer border is that of the ideal camera's picture, the farthest corner is beyond it.
  EXPECT_NEAR(lens.field_deg(), barrel.field_deg(60), 0.3);
  EXPECT_GT(lens.whole_field_deg(), lens.field_deg() + 2);
}

TEST(Lens, WithoutDistortionIsAPinholeAndLeavesPicturesAsTheyAre) {
  LensCalibration none;
  none.width = 160;
  none.height = 120;
  const Pinhole pinhole = pinhole_of(60, 160, 120);
  none.focal_px = {pinhole.focal_px, pinhole.focal_px};
  none.middle_px = {pinhole.middle_x, pinhole.middle_y};
  const Lens lens(none);
  EXPECT_NEAR(lens.field_deg(), 60, 1e-6);
  EXPECT_NEAR(lens.whole_field_deg(), 60, 1e-6);
  EXPECT_NEAR(lens.drawn_in(), 0, 1e-12);
  Picture picture(160, 120);
  for (std::size_t i = 0; i < picture.rgb.size(); ++i)
    picture.rgb[i] = static_cast<std::uint8_t>(i * i % 251);
  StraightPictures straight(lens);
  EXPECT_EQ(straight.straight(picture).rgb, picture.rgb);
  const BentPictures bent(lens, 160, 120);
  ASSERT_EQ(bent.drawn_width(), 160);
  EXPECT_EQ(bent.bent(picture, {1, 2, 3}).rgb, picture.rgb);
}

/// Of a place in the plane: soft, and nowhere alike.
std::array<double, 3> colour_at(const Vector2d& plane) {
  return {128 + 90 * std::sin(5 * plane.x()), 128 + 90 * std::cos(6 * plane.y()),
          128 + 90 * std::sin(3 * plane.x() * plane.y())};
}

void paint(Picture& picture, const std::function<Vector2d(int x, int y)>& plane_of) {
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const auto colour = colour_at(plane_of(x, y));
      for (std::size_t c = 0; c < 3; ++c)
        picture.pixel(x, y)[c] = static_cast<std::uint8_t>(std::lround(colour[c]));
    }
  }
}

int largest_difference(const Picture& a, const Picture& b) {
  int most = 0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i)
    most = std::max(most, std::abs(int(a.rgb[i]) - int(b.rgb[i])));
  return most;
}

TEST(LensPictures, AreStraightenedAndBentToTheSamePlacesAlsoInAnotherSize) {
  for (const LensCalibration& calibration : {brown(), fisheye()}) {
    const Lens lens(calibration);
    for (const int shrink : {1, 2}) {
      const int width = 640 / shrink, height = 480 / shrink;
      Picture recorded(width, height), ideal(width, height);
      const auto in_calibration = [&](int x, int y) {
        return Vector2d((x + 0.5) * shrink - 0.5, (y + 0.5) * shrink - 0.5);
      };
      paint(recorded, [&](int x, int y) { return lens.plane_of(in_calibration(x, y)); });
      const Pinhole pinhole = pinhole_of(lens.field_deg(), width, height);
      paint(ideal, [&](int x, int y) {
        return Vector2d((x - pinhole.middle_x) / pinhole.focal_px, (y - pinhole.middle_y) / pinhole.focal_px);
      });
      StraightPictures straight(lens);
      EXPECT_LE(largest_difference(straight.straight(recorded), ideal), 2);

      const BentPictures bent(lens, width, height);
      EXPECT_GT(bent.drawn_width(), width);
      Picture drawn(bent.drawn_width(), bent.drawn_height());
      const Vector2d half = bent.drawn({}).half_extent;
      paint(drawn, [&](int x, int y) {
        return Vector2d((2 * (x + 0.5) / drawn.width - 1) * half.x(),
                        (2 * (y + 0.5) / drawn.height - 1) * half.y());
      });
      EXPECT_LE(largest_difference(bent.bent(drawn, {0, 0, 0}), recorded), 2) << "its corners, too";
    }
  }
}

TEST(LensPictures, MixNoBackgroundIntoWhatIsDrawn) {
  const Lens lens(brown());
  const BentPictures bent(lens, 640, 480);
  constexpr Rgb kBackground{0, 0, 0};
  Picture drawn(bent.drawn_width(), bent.drawn_height());
  for (int y = 0; y < drawn.height; ++y) {
    for (int x = 0; x < drawn.width / 2; ++x) drawn.pixel(x, y)[1] = 200;
  }
  const Picture made = bent.bent(drawn, kBackground);
  std::size_t green = 0;
  for (std::size_t i = 1; i < made.rgb.size(); i += 3) {
    ASSERT_TRUE(made.rgb[i] == 0 || made.rgb[i] == 200) << int(made.rgb[i]);
    green += made.rgb[i] == 200 ? 1U : 0U;
  }
  EXPECT_GT(green, 640U * 480 / 3);
  EXPECT_LT(green, 640U * 480 * 2 / 3);
}

TEST(Lens, IsRefusedWhereItsNumbersAreNone) {
  EXPECT_EQ(refusal(brown()), "taken");
  const auto with = [](auto&& change) {
    LensCalibration lens = brown();
    change(lens);
    return refusal(lens);
  };
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(with([](auto& lens) { lens.coefficients[1] = kNone; }), HasSubstr("NaN"));
  EXPECT_THAT(with([](auto& lens) { lens.focal_px.x() = kNone; }), HasSubstr("NaN"));
  EXPECT_THAT(with([](auto& lens) { lens.middle_px.y() = std::numeric_limits<double>::infinity(); }),
              HasSubstr("infinite"));
  EXPECT_THAT(with([](auto& lens) { lens.focal_px.y() = -430; }), HasSubstr("must be positive"));
  EXPECT_THAT(with([](auto& lens) { lens.focal_px.y() = 1000; }), HasSubstr("neither twice the other"));
  EXPECT_THAT(with([](auto& lens) { lens.middle_px.x() = 20; }), HasSubstr("not near their middle"));
  EXPECT_THAT(with([](auto& lens) { lens.width = 0; }), HasSubstr("0x480 pixels"));
  EXPECT_THAT(with([](auto& lens) { lens.focal_px = {9000, 9000}; }), HasSubstr("less than 10 degrees"));
}

TEST(Lens, IsRefusedWhereItFoldsThePicture) {
  LensCalibration folds = brown();
  // r - 0.6 r^3 turns back at r = 0.75, which is shown at 0.5: the corners are at more than 0.9.
  folds.coefficients = {-0.6, 0, 0, 0, 0};
  EXPECT_THAT(refusal(folds), HasSubstr("not monotone within the picture"));
  // Monotone along the axis, turned over by what is decentred.
  LensCalibration decentred = brown();
  decentred.coefficients = {0, 0, 0.9, 0.9, 0};
  EXPECT_THAT(refusal(decentred), HasSubstr("not monotone within the picture"));
  LensCalibration wide = fisheye();
  wide.focal_px = {150, 150};
  EXPECT_THAT(refusal(wide), HasSubstr("80 degrees off the axis"));
}

TEST(Lens, IsRefusedForPicturesOfAnotherShape) {
  const Lens lens(brown());
  EXPECT_NO_THROW(lens.require_shape(1280, 960));
  EXPECT_NO_THROW(lens.require_shape(320, 241)) << "rounded to even sides";
  StraightPictures straight(lens);
  try {
    (void)straight.straight(Picture(1920, 1080));
    FAIL() << "it was taken";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("1920x1080"));
    EXPECT_THAT(error.what(), HasSubstr("640x480"));
  }
}

std::string yaml(const std::string& camera, const std::string& distortion, const std::string& more = "") {
  const auto matrix = [](int rows, int columns, const std::string& data) {
    return "!!opencv-matrix\n   rows: " + std::to_string(rows) + "\n   cols: " + std::to_string(columns) +
           "\n   dt: d\n   data: [ " + data + " ]\n";
  };
  const auto count = static_cast<int>(std::ranges::count(distortion, ',')) + 1;
  return "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n" + more +
         "camera_matrix: " + matrix(3, 3, camera) +
         "distortion_coefficients: " + matrix(count, 1, distortion);
}
constexpr const char* kCamera = "430., 0., 331.5, 0., 436., 226., 0., 0., 1.";
constexpr const char* kDistortion = "-0.28, 0.09, 0.0011, -0.0016, -0.012";

TEST(LensFile, IsReadAsOpenCvWritesItInEachOfItsForms) {
  for (const char* const form : {".yml", ".xml", ".json"}) {
    for (const LensCalibration& lens : {brown(), fisheye()}) {
      const bool is_fisheye = lens.model == LensModel::kFisheye;
      const LensCalibration written =
          read_lens_calibration(lens_calibration_text(lens, 0.1, 9, form), "lens");
      EXPECT_EQ(written.coefficients, lens.coefficients) << form;
      EXPECT_EQ(written.focal_px, lens.focal_px) << form;
      EXPECT_EQ(written.model, lens.model) << form;
      cv::FileStorage file(form, cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
      file << "image_width" << lens.width << "image_height" << lens.height;
      file << "camera_matrix"
           << cv::Mat(cv::Matx33d(lens.focal_px.x(), 0, lens.middle_px.x(), 0, lens.focal_px.y(),
                                  lens.middle_px.y(), 0, 0, 1));
      file << "distortion_coefficients"
           << cv::Mat(std::vector<double>(lens.coefficients.begin(), lens.coefficients.end() - is_fisheye),
                      true);
      if (is_fisheye) file << "fisheye_model" << 1;
      const LensCalibration read = read_lens_calibration(file.releaseAndGetString(), "lens");
      EXPECT_EQ(read.model, lens.model) << form;
      EXPECT_EQ(read.width, lens.width);
      EXPECT_EQ(read.height, lens.height);
      EXPECT_EQ(read.focal_px, lens.focal_px);
      EXPECT_EQ(read.middle_px, lens.middle_px);
      EXPECT_EQ(read.coefficients, lens.coefficients);
    }
  }
}

TEST(LensFile, IsReadWithMoreCoefficientsOnlyWhereTheyAreNothing) {
  EXPECT_EQ(refusal(yaml(kCamera, std::string(kDistortion) + ", 0., 0., 0.")), "taken");
  EXPECT_EQ(refusal(yaml(kCamera, "-0.28, 0.09, 0., 0.")), "taken");
  EXPECT_THAT(refusal(yaml(kCamera, std::string(kDistortion) + ", 0.1, 0., 0.")),
              HasSubstr("8 coefficients (rational"));
  EXPECT_THAT(refusal(yaml(kCamera, "-0.28, 0.09")), HasSubstr("has 2 numbers"));
  EXPECT_THAT(refusal(yaml(kCamera, kDistortion, "fisheye_model: 1\n")), HasSubstr("a fisheye has k1"));
}

TEST(LensFile, IsRefusedWhereItIsNoCalibration) {
  for (const char* const text :
       {"", "hello", "{", "[1, 2]", "<?xml version=\"1.0\"?><a>", "%YAML:1.0\n---\n\t{"})
    EXPECT_THAT(refusal(text), HasSubstr("lens.yml cannot be read as YAML, XML or JSON")) << text;
  EXPECT_THAT(refusal("%YAML:1.0\n---\nfield_deg: 60\n"), HasSubstr("has no 'camera_matrix'"));
  EXPECT_THAT(refusal("{\"camera_matrix\": [1, 2, 3]}"), HasSubstr("lens.yml"));
  EXPECT_THAT(refusal(yaml("430., 0., 331.5, 0., 436., 226., 0., 0., 2.", kDistortion)),
              HasSubstr("not that of a camera"));
  EXPECT_THAT(refusal(yaml("430., 3., 331.5, 0., 436., 226., 0., 0., 1.", kDistortion)),
              HasSubstr("not that of a camera"));
  std::string sizeless = yaml(kCamera, kDistortion);
  sizeless.replace(sizeless.find("image_width: 640\n"), 17, "");
  EXPECT_THAT(refusal(sizeless), HasSubstr("has no 'image_width'"));
  const LensCalibration read = read_lens_calibration(yaml(kCamera, "-0.28, .NaN, 0., 0., 0."), "lens");
  EXPECT_THAT(refusal(read), HasSubstr("NaN"));
}

}  // namespace
}  // namespace kiroku::sim
