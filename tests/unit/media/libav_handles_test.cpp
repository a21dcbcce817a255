#include "media/libav_handles.h"

#include <thread>
#include <vector>

#include <gtest/gtest.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/log.h>
}

#include "base/error.h"

namespace kiroku::media {
namespace {

TEST(LibavHandles, MakesOneSentenceOfAnErrorCode) {
  EXPECT_EQ(libav_error_text(AVERROR_INVALIDDATA), "Invalid data found when processing input");
  try {
    throw_libav("cannot open the camera /dev/video9", AVERROR(ENOENT));
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "cannot open the camera /dev/video9: No such file or directory");
  }
  EXPECT_EQ(require(7, "read"), 7);
  EXPECT_THROW(require(AVERROR_EOF, "read"), Error);
}

TEST(LibavHandles, ReportsAnOptionThatNobodyUnderstood) {
  Options options;
  EXPECT_EQ(options.unused(), "");
  options.set("no_such_option", "1");
  const Options moved = std::move(options);
  EXPECT_EQ(moved.unused(), "no_such_option");
}

TEST(LibavHandles, RoutesTheLogLineByLine) {
  std::vector<std::pair<int, std::string>> lines;
  route_libav_log([&](int level, std::string_view line) { lines.emplace_back(level, line); });
  av_log(nullptr, AV_LOG_WARNING, "first ");
  av_log(nullptr, AV_LOG_WARNING, "half\nsecond\n");
  silence_libav();  // must not take the sink away
  av_log(nullptr, AV_LOG_ERROR, "third\n");
  route_libav_log({});
  av_log(nullptr, AV_LOG_ERROR, "unheard\n");
  const std::vector<std::pair<int, std::string>> expected = {
      {AV_LOG_WARNING, "first half"}, {AV_LOG_WARNING, "second"}, {AV_LOG_ERROR, "third"}};
  EXPECT_EQ(lines, expected);
}

TEST(LibavHandles, HearsTheErrorsOfItsThreadWhileItLives) {
  LibavComplaints outer;
  {
    const LibavComplaints inner;
    av_log(nullptr, AV_LOG_WARNING, "only a warning\n");
    EXPECT_EQ(inner.first(), "");
    av_log(nullptr, AV_LOG_ERROR, "first\n");
    av_log(nullptr, AV_LOG_ERROR, "second\n");
    std::thread([] { av_log(nullptr, AV_LOG_ERROR, "elsewhere\n"); }).join();
    EXPECT_EQ(inner.first(), "first");
  }
  EXPECT_EQ(outer.first(), "");
  std::thread([] { av_log(nullptr, AV_LOG_ERROR, "elsewhere\n"); }).join();
  EXPECT_EQ(outer.first(), "");
  av_log(nullptr, AV_LOG_ERROR, "outer\n");
  EXPECT_EQ(outer.first(), "outer");
  outer.clear();
  EXPECT_EQ(outer.first(), "");
}

TEST(LibavHandles, PrintsNothingOnTheTerminalOfAFailedOpen) {
  silence_libav();
  testing::internal::CaptureStderr();
  AVFormatContext* context = nullptr;
  EXPECT_LT(avformat_open_input(&context, "/nonexistent/film.ts", nullptr, nullptr), 0);
  av_log(nullptr, AV_LOG_FATAL, "chatter\n");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace kiroku::media
