#include "recorder/source/source_box.h"

#include <condition_variable>
#include <cstring>
#include <mutex>
#include <thread>
#include <unistd.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/frame.h>
#include <libavutil/samplefmt.h>
}

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "media/box/sandbox.h"
#include "recorder/source/ffmpeg_source.h"

namespace kiroku::recorder {
namespace {

using nlohmann::json;

constexpr std::size_t kLongestRequest = 1 << 20;
constexpr std::chrono::hours kNoLimit{1000};
/// A source that was told to end says good-bye to its server meanwhile.
constexpr std::chrono::seconds kLastWords{2};

template <typename Kind>
constexpr std::uint32_t number(Kind kind) {
  return static_cast<std::uint32_t>(kind);
}

media::BoxNeeds needs_of(const SourceAddress& address) {
  const SourceKind kind = address.kind;
  if (kind == SourceKind::kNetwork) {
    // "tcp://0.0.0.0:9000?listen=1": the camera connects to the recorder.
    const std::size_t query = address.location.find('?');
    const bool listens =
        query != std::string::npos && address.location.find("listen", query) != std::string::npos;
    return listens ? media::BoxNeeds::kServer : media::BoxNeeds::kNetwork;
  }
  return kind == SourceKind::kDevice ? media::BoxNeeds::kDevice : media::BoxNeeds::kNothing;
}

class SourceBox {
 public:
  SourceBox() : lender_(media::kMemoryDescriptor), channel_(Descriptor(media::kChannelDescriptor)) {}

  void run() {
    const json asked = first_request();
    sign_of_life();
    std::thread([this] { listen(); }).detach();
    try {
      open(asked);
      wait([this] { return begun_; });
      while (std::optional<TimedFrame> frame = source_->read()) hand_out(*frame);
      say(FromSourceBox::kEnded, "");
    } catch (const UsageError& error) {
      say_failure(error, true);
    } catch (const std::exception& error) {
      say_failure(error, false);
    }
    std::unique_ptr<Source> closing;
    {
      const std::lock_guard guard(mutex_);
      closing = std::move(source_);
    }
    closing.reset();
    wait([this] { return gone_; });
  }

 private:
  json first_request() {
    const auto message = channel_.receive(kNoLimit, kLongestRequest);
    if (!message || message->kind != number(ToSourceBox::kOpen)) throw Error("nothing is asked for");
    return json::parse(text_of(message->body));
  }

  void sign_of_life() { lender_.page().pulse.fetch_add(1, std::memory_order_relaxed); }

  void open(const json& asked) {
    SourceAddress address;
    address.kind = static_cast<SourceKind>(asked.at("kind").get<int>());
    address.location = asked.at("location");
    address.stated = asked.at("stated");
    address.options = asked.at("options").get<std::map<std::string, std::string>>();
    clock_ = CaseClock(asked.at("zero_ns").get<std::int64_t>());
    hooks_.close = [needs = needs_of(address)] { media::close_box(needs); };
    hooks_.lend = [this](AVCodecContext& codec) { lender_.lend_to(codec); };
    hooks_.make_packet = [this](AVPacket& packet, int bytes) { return make_packet(packet, bytes); };
    OpeningTerms terms;
    terms.patience = std::chrono::nanoseconds(asked.at("patience_ns").get<std::int64_t>());
    terms.silence = std::chrono::nanoseconds(asked.at("silence_ns").get<std::int64_t>());
    terms.sound = asked.at("sound");
    terms.cancelled = &cancelled_;
    terms.pulse = &lender_.page().pulse;
    terms.box = &hooks_;
    std::unique_ptr<Source> made = open_ffmpeg_source(address, clock_, terms);
    const PictureFormat format = made->format();
    json facts{{"width", format.width},
               {"height", format.height},
               {"pixel_format", format.pixel_format},
               {"aspect", {format.sample_aspect.numerator, format.sample_aspect.denominator}},
               {"colours",
                {format.colour_range, format.colour_primaries, format.colour_transfer, format.colour_space}},
               {"rate", {made->frame_rate().numerator, made->frame_rate().denominator}},
               {"coding", {made->coding().name, static_cast<int>(made->coding().loss)}},
               {"treatment",
                {static_cast<int>(made->treatment().turn), made->treatment().is_turned ? 1 : 0,
                 static_cast<int>(made->treatment().fields)}},
               {"input", made->input()},
               {"remark", made->remark()}};
    if (const auto sound = made->sound_format())
      facts["sound"] = {sound->sample_rate, sound->channels, sound->sample_format};
    {
      const std::lock_guard guard(mutex_);
      source_ = std::move(made);
      if (gone_) source_->interrupt();
    }
    say(FromSourceBox::kOpened, facts.dump(-1, ' ', false, json::error_handler_t::replace));
  }

  bool make_packet(AVPacket& packet, int bytes) {
    media::BufferReference memory =
        lender_.take(static_cast<std::size_t>(bytes) + AV_INPUT_BUFFER_PADDING_SIZE);
    if (!memory) return false;
    std::memset(memory->data + bytes, 0, AV_INPUT_BUFFER_PADDING_SIZE);
    packet.buf = memory.release();
    packet.data = packet.buf->data;
    packet.size = bytes;
    return true;
  }

  void hand_out(const TimedFrame& frame) {
    wait([this] { return on_the_way_ < kMostOnTheWay; });
    if (frame.is_sound) {
      hand_out_sound(frame);
    } else {
      PictureMessage message;
      if (!lender_.hand_out(*frame.frame, message.note)) {
        lost_here_ += 1 + frame.lost_before;
        return;
      }
      message.time_ns = frame.time_ns;
      message.lost_before = frame.lost_before + lost_here_;
      message.time_break = static_cast<std::uint32_t>(frame.time_break);
      message.turn = static_cast<std::uint32_t>(frame.treatment.turn);
      message.is_turned = frame.treatment.is_turned ? 1 : 0;
      message.lost_on_the_way = frame.lost_on_the_way && lost_here_ == 0 ? 1 : 0;
      lost_here_ = 0;
      count_one();
      channel_.send(number(FromSourceBox::kPicture), std::as_bytes(std::span(&message, 1)));
    }
  }

  void hand_out_sound(const TimedFrame& frame) {
    const AVFrame& sound = *frame.frame;
    const auto format = static_cast<AVSampleFormat>(sound.format);
    const SoundMessage message{frame.time_ns, sound.sample_rate, sound.ch_layout.nb_channels, sound.format,
                               sound.nb_samples};
    Bytes body = to_bytes(std::as_bytes(std::span(&message, 1)));
    const bool planar = av_sample_fmt_is_planar(format) != 0;
    const auto bytes = static_cast<std::size_t>(av_get_bytes_per_sample(format)) *
                       static_cast<std::size_t>(sound.nb_samples) *
                       static_cast<std::size_t>(planar ? 1 : message.channels);
    for (int plane = 0; plane < (planar ? message.channels : 1); ++plane) {
      append(body, std::as_bytes(std::span(sound.extended_data[plane], bytes)));
    }
    count_one();
    channel_.send(number(FromSourceBox::kSound), body);
  }

  void count_one() {
    const std::lock_guard guard(mutex_);
    ++on_the_way_;
  }

  void say(FromSourceBox kind, const std::string& text) { channel_.send(number(kind), text); }
  void say_failure(const std::exception& error, bool usage) {
    const json text{{"usage", usage}, {"text", error.what()}};
    say(FromSourceBox::kFailed, text.dump(-1, ' ', false, json::error_handler_t::replace));
  }

  template <typename Condition>
  void wait(const Condition& holds) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return gone_ || holds(); });
  }

  /// What the other end says, on a thread of its own, until it is gone.
  void listen() {
    try {
      for (;;) {
        const auto message = channel_.receive(kNoLimit, kLongestRequest);
        if (!message) continue;
        const std::lock_guard guard(mutex_);
        if (message->kind == number(ToSourceBox::kBegin) && message->body.size() == sizeof(std::int64_t)) {
          std::int64_t zero_ns = 0;
          std::memcpy(&zero_ns, message->body.data(), sizeof zero_ns);
          clock_ = CaseClock(zero_ns);  // the source is not read yet
          begun_ = true;
        } else if (message->kind == number(ToSourceBox::kTaken) && on_the_way_ > 0) {
          --on_the_way_;
        }
        changed_.notify_all();
      }
    } catch (const ChannelError&) {
    }
    cancelled_ = true;
    {
      const std::lock_guard guard(mutex_);
      gone_ = true;
      if (source_) source_->interrupt();
    }
    changed_.notify_all();
    std::this_thread::sleep_for(kLastWords);
    ::_exit(0);
  }

  using ChannelError = media::ChannelError;

  media::PictureLender lender_;
  media::Channel channel_;
  CaseClock clock_;
  BoxHooks hooks_;
  std::uint64_t lost_here_ = 0;
  std::atomic<bool> cancelled_ = false;
  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::unique_ptr<Source> source_;  // set and taken by run()
  unsigned on_the_way_ = 0;
  bool begun_ = false, gone_ = false;
};

}  // namespace

void run_source_box() {
  try {
    media::limit_process(0);
    SourceBox().run();
  } catch (const std::exception&) {  // the other end is gone, or will see that this one is
    ::_exit(1);
  }
  ::_exit(0);
}

}  // namespace kiroku::recorder
