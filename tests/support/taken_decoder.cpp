// Plays a kiroku-decoder that was taken over by what it decoded: it stands beside the tests in the place of
// the true one, and does what the last part of the source's address says ("pulses", "future", …).

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <unistd.h>

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixfmt.h>
}

#include <nlohmann/json.hpp>

#include "media/box/channel.h"
#include "media/box/child.h"
#include "media/box/job_messages.h"
#include "media/box/picture_memory.h"
#include "media/libav_handles.h"
#include "recorder/source/source_box.h"

namespace {

using namespace kiroku;
using namespace std::chrono_literals;
using nlohmann::json;
using recorder::FromSourceBox;

constexpr std::size_t kMost = 1 << 20;
constexpr std::chrono::hours kNoLimit{1000};
constexpr int kSide = 64;

template <typename Kind>
std::uint32_t number(Kind kind) {
  return static_cast<std::uint32_t>(kind);
}

class TakenSource {
 public:
  explicit TakenSource(media::Channel& channel) : channel_(channel), lender_(media::kMemoryDescriptor) {}

  [[noreturn]] void run() {
    const json asked = json::parse(text_of(channel_.receive(kNoLimit, kMost)->body));
    manner_ = std::filesystem::path(asked.at("location").get<std::string>()).filename();
    if (manner_ == "pulses") give_signs_of_life();
    channel_.send(number(FromSourceBox::kOpened), facts());
    if (manner_ == "opens-and-pulses") give_signs_of_life();
    await(recorder::ToSourceBox::kBegin);
    for (int given = 0;; ++given) {
      if (manner_ == "ends" && given == 3) channel_.send(number(FromSourceBox::kEnded), "");
      give_picture();
      if (manner_ == "deaf") continue;
      await(recorder::ToSourceBox::kTaken);
      std::this_thread::sleep_for(40ms);
    }
  }

 private:
  /// Until the recorder is gone.
  [[noreturn]] void give_signs_of_life() {
    for (;;) {
      ++lender_.page().pulse;
      (void)channel_.receive(5ms, kMost);
    }
  }

  void await(recorder::ToSourceBox kind) {
    for (;;) {
      const auto message = channel_.receive(5ms, kMost);
      ++lender_.page().pulse;
      if (message && message->kind == number(kind)) return;
    }
  }

  [[nodiscard]] std::string facts() const {
    json facts{{"width", kSide},
               {"height", kSide},
               {"pixel_format", int(AV_PIX_FMT_YUV420P)},
               {"aspect", {1, 1}},
               {"rate", {25, 1}},
               {"colours", {1, 2, 2, 2}},
               {"live", manner_ != "future"},
               {"input", "64x64"},
               {"coding", {"ffv1", 1}},
               {"treatment", {0, 0, 0}},
               {"remark", ""}};
    if (manner_ == "slow") facts["rate"] = {1, INT32_MAX};
    if (manner_ == "fast") facts["rate"] = {INT32_MAX, 1};
    if (manner_ == "hardware") facts["pixel_format"] = int(AV_PIX_FMT_VAAPI);
    if (manner_ == "talks") facts["remark"] = std::string(200'000, 'x');
    if (manner_ == "controls") facts["input"] = "64x64\x1b[2J\u202e";
    if (manner_ == "deep") return std::string(30'000, '[') + std::string(30'000, ']');
    return facts.dump();
  }

  void give_picture() {
    media::Frame frame = media::make_frame();
    frame->format = AV_PIX_FMT_YUV420P;
    frame->width = frame->height = kSide;
    if (av_frame_get_buffer(frame.get(), 0) < 0) ::_exit(1);
    for (int plane = 0; plane < 3; ++plane)
      std::memset(frame->data[plane], 100, static_cast<std::size_t>(frame->linesize[plane]) * kSide / 2);
    recorder::PictureMessage message;
    if (!lender_.hand_out(*frame, message.note)) return;  // all of the memory is held
    message.time_ns = manner_ == "past" ? INT64_MIN : INT64_MAX;
    channel_.send(number(FromSourceBox::kPicture), std::as_bytes(std::span(&message, 1)));
  }

  media::Channel& channel_;
  media::PictureLender lender_;
  std::string manner_;
};

/// Jobs of who reads a stream's pictures, whose name says what is answered.
class TakenSpan {
 public:
  explicit TakenSpan(media::Channel& channel) : channel_(channel) {}

  [[noreturn]] void run(json job) {
    for (;; job = json::parse(text_of(channel_.receive(kNoLimit, kMost)->body))) {
      const std::string what = job.at("what");
      if (what == "index") manner_ = job.at("with").at("name").get<std::string>();
      if (what == "span-pixels") give_pixels();
      const json told = what == "span-next" ? next() : json::object();
      channel_.send(number(media::FromJobBox::kDone), told.dump());
    }
  }

 private:
  json next() {
    ++given_;
    if (manner_ == "backwards") return {{"time", 2 - given_}, {"width", kSide}, {"height", kSide}};
    if (manner_ == "huge") return {{"time", given_}, {"width", 1 << 20}, {"height", kSide}};
    if (manner_ == "far") return {{"time", INT64_MAX}, {"width", kSide}, {"height", kSide}};
    if (manner_ == "text") return {{"time", "now"}, {"width", kSide}, {"height", kSide}};
    return {{"time", given_}, {"width", kSide}, {"height", kSide}};
  }
  void give_pixels() {
    const std::size_t right = std::size_t{3} * kSide * kSide;
    const std::string bytes(manner_ == "short" ? right - 1 : right + 1, 'x');
    channel_.send(number(media::FromJobBox::kBytes), bytes);
  }

  media::Channel& channel_;
  std::string manner_;
  std::int64_t given_ = 0;
};

/// A job that asks for the same again and again, or makes nothing without end.
void do_jobs(media::Channel& channel) {
  channel.send(number(media::FromJobBox::kReady), "");
  const json job = json::parse(text_of(channel.receive(kNoLimit, kMost)->body));
  if (job.at("what") == "index") TakenSpan(channel).run(job);
  for (;;) {
    if (job.at("what") == "make nothing") {
      channel.send(number(media::FromJobBox::kBytes), "");
    } else {
      const media::SegmentNumber asked{7};
      channel.send(number(media::FromJobBox::kOpen), std::as_bytes(std::span(&asked, 1)));
      (void)channel.receive(kNoLimit, kMost);
    }
  }
}

}  // namespace

int main(int count, char** arguments) {
  const std::string role = count > 1 ? arguments[1] : "";
  media::Channel channel{Descriptor(media::kChannelDescriptor)};
  try {
    if (role == "probe") {
      channel.send(0, "");
    } else if (role == "source") {
      TakenSource(channel).run();
    } else if (role == "segments") {
      do_jobs(channel);
    } else if (role == "worklist") {
      // It says again and again that its question begins.
      for (;; std::this_thread::sleep_for(20ms)) channel.send(1, "");
    }
  } catch (const std::exception&) {  // the recorder has closed its end
  }
  ::_exit(0);
}
