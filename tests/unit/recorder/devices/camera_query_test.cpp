#include "recorder/devices/camera_query.h"

#include <linux/videodev2.h>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

CameraMode mode(const std::string& format, std::uint32_t width, std::uint32_t height, CameraRate rate) {
  return {format, !format.empty() && format != "pBAA", width, height, rate};
}

TEST(CameraQuery, AsksForTheLargestThatIsSmooth) {
  // As a common webcam lists them: without compression its cable holds few large pictures.
  const std::vector<CameraMode> webcam{mode("yuyv422", 640, 480, {30, 1}),
                                       mode("yuyv422", 1920, 1080, {5, 1}), mode("mjpeg", 640, 480, {30, 1}),
                                       mode("mjpeg", 1920, 1080, {30, 1})};
  EXPECT_EQ(options_of(*best_mode(webcam)), "?size=1920x1080&rate=30&format=mjpeg");
}

TEST(CameraQuery, TakesWhatIsCompressedLeastOfEquals) {
  const std::vector<CameraMode> grabber{mode("mjpeg", 1920, 1080, {60, 1}), mode("h264", 1920, 1080, {60, 1}),
                                        mode("nv12", 1920, 1080, {60, 1}),
                                        mode("yuyv422", 1920, 1080, {60, 1})};
  EXPECT_EQ(best_mode(grabber)->format, "yuyv422");
}

TEST(CameraQuery, TakesSlowPicturesWhereThereAreNoOthers) {
  EXPECT_EQ(best_mode({mode("yuyv422", 640, 480, {15, 1}), mode("yuyv422", 1280, 720, {10, 1})})->width,
            1280U);
}

TEST(CameraQuery, AsksForNothingThatIsNotRead) {
  EXPECT_EQ(best_mode({}), std::nullopt);
  EXPECT_EQ(best_mode({mode("pBAA", 3280, 2464, {30, 1})}), std::nullopt);
  EXPECT_EQ(best_mode({mode("pBAA", 3280, 2464, {30, 1}), mode("gray", 640, 480, {30, 1})})->format, "gray");
}

TEST(CameraQuery, WritesRatesAsTheSourceTakesThem) {
  EXPECT_EQ(options_of(mode("uyvy422", 720, 576, {25, 1})), "?size=720x576&rate=25&format=uyvy422");
  EXPECT_EQ(options_of(mode("uyvy422", 720, 480, {30000, 1001})),
            "?size=720x480&rate=30000/1001&format=uyvy422");
  EXPECT_EQ(options_of(mode("uyvy422", 720, 480, {})), "?size=720x480&format=uyvy422");
}

TEST(CameraQuery, KnowsFormatsByTheNamesOfTheSourcesOption) {
  EXPECT_EQ(camera_format_name(V4L2_PIX_FMT_YUYV), "yuyv422");
  EXPECT_EQ(camera_format_name(V4L2_PIX_FMT_MJPEG), "mjpeg");
  EXPECT_EQ(camera_format_name(V4L2_PIX_FMT_SBGGR10P), "");
}

TEST(CameraQuery, RefusesWhatIsNoCamera) {
  EXPECT_THROW(ask_camera("/dev/null"), Error);
  EXPECT_THROW(ask_camera("/dev/there-is-no-such-camera"), IoError);
}

}  // namespace
}  // namespace kiroku::recorder
