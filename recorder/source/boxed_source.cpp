#include "recorder/source/boxed_source.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <utility>

extern "C" {
#include <libavutil/channel_layout.h>
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
#include <libavutil/samplefmt.h>
}

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/foreign_json.h"
#include "base/printable.h"
#include "media/box/child.h"
#include "media/box/picture_memory.h"
#include "recorder/source/ffmpeg_source.h"
#include "recorder/source/source_box.h"

namespace kiroku::recorder {
namespace {

using media::require;
using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::steady_clock;

constexpr milliseconds kStep{20};
/// A process is started and its libraries loaded meanwhile, also on a machine that is busy.
constexpr std::chrono::seconds kStarting{30};
/// A server is told good-bye, so that it does not keep a session for nobody.
constexpr milliseconds kGoodBye{500};
constexpr std::size_t kLongestMessage = 8 << 20;  // a second of sound, many channels
constexpr std::size_t kLongestText = 2000, kLongestFacts = 64 << 10;
constexpr int kMostChannels = 64, kLargestSide = 16'384;
constexpr std::uint64_t kMostLost = 1'000'000;
// A decoder that was taken over gives signs of life for as long as it likes. A source of which nothing else
// comes for so many times its longest silence is lost; a film may pause for as long as its largest jump.
constexpr int kMostSilences = 12;
constexpr std::chrono::seconds kLongestPauseOfFilm{60};

std::string text_from(const json& from, const char* name) {
  return printable(from.at(name).get<std::string>().substr(0, kLongestText));
}

int within(const json& value, int least, int most) {
  const auto number = value.get<std::int64_t>();
  if (number < least || number > most) throw Error("a number is out of range");
  return static_cast<int>(number);
}

class BoxedSource : public Source {
 public:
  BoxedSource(const SourceAddress& address, const CaseClock& clock, const OpeningTerms& terms)
      : clock_(clock),
        pulse_(terms.pulse),
        silence_(terms.silence),
        name_("source '" + address.stated + "'"),
        live_(address.kind != SourceKind::kFile),
        unpaced_(address.unpaced()),
        polite_(address.kind == SourceKind::kNetwork),
        memory_(media::make_shared_memory(media::kPictureMemoryBytes)),
        pictures_(std::make_shared<media::PictureBorrower>(memory_.number())),
        child_("source", memory_) {
    const json asked{{"kind", static_cast<int>(address.kind)},
                     {"location", address.location},
                     {"stated", address.stated},
                     {"options", address.options},
                     {"zero_ns", clock.zero_ns()},
                     {"patience_ns", terms.patience.count()},
                     {"silence_ns", terms.silence.count()},
                     {"sound", terms.sound}};
    say(ToSourceBox::kOpen, bytes_of(asked.dump(-1, ' ', false, json::error_handler_t::replace)));
    const auto answer = await(
        [&] { return terms.cancelled != nullptr && *terms.cancelled; },
        {terms.patience + std::max<nanoseconds>(silence_, live_ ? silence_ : kStarting), "been opened"});
    if (!answer) throw Error(name_ + " was not opened: nobody waits for it any more");
    if (is(*answer, FromSourceBox::kFailed)) throw_failure(answer->body);
    if (!is(*answer, FromSourceBox::kOpened)) throw_nonsense();
    take_facts(answer->body);
  }
  ~BoxedSource() override {
    const nanoseconds patience = std::min<nanoseconds>(kGoodBye, silence_ / 2);
    child_.end(polite_ ? std::chrono::duration_cast<milliseconds>(patience) : milliseconds(0));
  }
  BoxedSource(const BoxedSource&) = delete;
  BoxedSource& operator=(const BoxedSource&) = delete;

  [[nodiscard]] PictureFormat format() const override { return format_; }
  [[nodiscard]] Rational frame_rate() const override { return rate_; }
  [[nodiscard]] std::optional<SoundFormat> sound_format() const override { return sound_; }
  [[nodiscard]] bool is_live() const override { return live_; }
  [[nodiscard]] std::string input() const override { return input_; }
  [[nodiscard]] SourceCoding coding() const override { return coding_; }
  [[nodiscard]] std::string remark() const override { return remark_; }
  [[nodiscard]] PictureTreatment treatment() const override { return treatment_; }

  std::optional<TimedFrame> read() override {
    if (!std::exchange(begun_, true)) {
      const std::int64_t zero_ns = clock_.zero_ns();
      say(ToSourceBox::kBegin, std::as_bytes(std::span(&zero_ns, 1)));
    }
    const nanoseconds longest = kMostSilences * silence_;
    const auto message = await(
        [] { return false; },
        {live_ ? longest : std::max<nanoseconds>(longest, kLongestPauseOfFilm), "given picture or sound"});
    if (!message) return {};
    if (is(*message, FromSourceBox::kEnded)) {
      if (!live_) return {};
      throw_nonsense("that a live source has come to its end");
    }
    if (is(*message, FromSourceBox::kFailed)) throw_failure(message->body);
    std::optional<TimedFrame> frame;
    if (is(*message, FromSourceBox::kPicture)) {
      frame = picture_of(message->body);
    } else if (is(*message, FromSourceBox::kSound)) {
      frame = sound_of(message->body);
    } else {
      throw_nonsense();
    }
    say(ToSourceBox::kTaken, {});
    return frame;
  }

 private:
  using Message = media::Channel::Message;

  static bool is(const Message& message, FromSourceBox kind) {
    return message.kind == static_cast<std::uint32_t>(kind);
  }
  void say(ToSourceBox kind, ByteView body) {
    // Longer, and the thread that waits here would be given up for its driver's sake.
    const auto patience = std::chrono::duration_cast<milliseconds>(silence_ / 2);
    try {
      child_.channel().send(static_cast<std::uint32_t>(kind), body, patience);
    } catch (const media::ChannelError&) {
      throw_ended();
    }
  }

  /// How long a message may take though there are signs of life, and what has not been done by then.
  struct Bound {
    nanoseconds whole;
    const char* doing;
  };

  /// The next message; nothing where the wait was ended from outside.
  template <typename MustEnd>
  std::optional<Message> await(const MustEnd& must_end, const Bound& bound) {
    std::uint64_t pulse = pictures_->pulse();
    nanoseconds silent{0}, waited{0};
    steady_clock::time_point before = steady_clock::now();
    while (!interrupted() && !must_end()) {
      std::optional<Message> message;
      try {
        message = child_.channel().receive(kStep, kLongestMessage);
      } catch (const media::ChannelError&) {
        throw_ended();
      }
      if (message) return message;
      // This thread waits for no driver, so it is never stuck itself.
      if (pulse_ != nullptr) ++*pulse_;
      const steady_clock::time_point now = steady_clock::now();
      // Where this thread was kept from running, so was the decoder: that says nothing against it.
      const nanoseconds passed = std::min<nanoseconds>(now - before, 2 * kStep);
      before = now;
      silent = std::exchange(pulse, pictures_->pulse()) == pulse ? silent + passed : nanoseconds(0);
      lives_ = lives_ || pulse != 0;
      if (lives_) waited += passed;
      if (silent >= (lives_ ? silence_ : std::max<nanoseconds>(silence_, kStarting)))
        throw_too_long("answered", silent);
      if (waited >= bound.whole) throw_too_long(bound.doing, waited);
    }
    return {};
  }

  [[noreturn]] void throw_too_long(const std::string& doing, nanoseconds time) {
    child_.end();
    char seconds[32];
    std::snprintf(seconds, sizeof seconds, "%.3g s", std::chrono::duration<double>(time).count());
    throw DecoderLost(name_ + " has not " + doing + " for " + seconds + ": its decoder was killed");
  }

  [[noreturn]] void throw_ended() {
    const auto patience =
        std::chrono::duration_cast<milliseconds>(std::min<nanoseconds>(kGoodBye, silence_ / 2));
    throw DecoderLost("the decoder of " + name_ + " " + child_.how_it_ended(patience));
  }
  /// `what` it says, where that helps whoever looks for the cause.
  [[noreturn]] void throw_nonsense(const std::string& what = "what it may not") {
    child_.end();
    throw DecoderLost("the decoder of " + name_ + " says " + what + ": it was killed");
  }
  [[noreturn]] void throw_failure(ByteView body) {
    std::string text;
    bool usage = false;
    try {
      const json failure = parse_short(body);
      text = text_from(failure, "text");
      usage = failure.at("usage");
    } catch (const std::exception&) {
      throw_nonsense();
    }
    if (usage) throw UsageError(text);
    throw Error(text);
  }

  static json parse_short(ByteView body) {
    if (body.size() > kLongestFacts) throw Error("it is too long");
    return parse_foreign_json(text_of(body));
  }

  /// What the recorder cannot know better. Whether the source is live, and by which clock its pictures are
  /// timed, follows from its address.
  void take_facts(ByteView body) {
    std::string wrong = "what it may not";
    try {
      const json facts = parse_short(body);
      const auto pair = [&](const char* name) {
        return Rational{within(facts.at(name).at(0), 0, INT32_MAX),
                        within(facts.at(name).at(1), 1, INT32_MAX)};
      };
      format_.width = within(facts.at("width"), 1, kLargestSide);
      format_.height = within(facts.at("height"), 1, kLargestSide);
      format_.pixel_format = within(facts.at("pixel_format"), 0, INT32_MAX);
      const AVPixFmtDescriptor* const pixels =
          av_pix_fmt_desc_get(static_cast<AVPixelFormat>(format_.pixel_format));
      if (pixels == nullptr || (pixels->flags & AV_PIX_FMT_FLAG_HWACCEL) != 0)
        throw Error("a pixel format is unknown");
      format_.sample_aspect = pair("aspect");
      const json& colours = facts.at("colours");
      format_.colour_range = within(colours.at(0), 0, AVCOL_RANGE_NB - 1);
      format_.colour_primaries = within(colours.at(1), 0, AVCOL_PRI_NB - 1);
      format_.colour_transfer = within(colours.at(2), 0, AVCOL_TRC_NB - 1);
      format_.colour_space = within(colours.at(3), 0, AVCOL_SPC_NB - 1);
      rate_ = pair("rate");
      if (!is_believable(rate_)) {
        wrong = "that a picture comes " + std::to_string(rate_.numerator) + "/" +
                std::to_string(rate_.denominator) + " times a second";
        throw Error("a rate cannot be");
      }
      const json& coding = facts.at("coding");
      coding_.name = printable(coding.at(0).get<std::string>().substr(0, kLongestText));
      coding_.loss = static_cast<CodingLoss>(within(coding.at(1), 0, static_cast<int>(CodingLoss::kCertain)));
      const json& treatment = facts.at("treatment");
      treatment_.turn = static_cast<Turn>(within(treatment.at(0), 0, static_cast<int>(kLastTurn)));
      treatment_.is_turned = within(treatment.at(1), 0, 1) == 1;
      treatment_.fields =
          static_cast<FieldOrder>(within(treatment.at(2), 0, static_cast<int>(FieldOrder::kLowerFirst)));
      input_ = text_from(facts, "input");
      remark_ = text_from(facts, "remark");
      if (const auto sound = facts.find("sound"); sound != facts.end()) {
        sound_ = SoundFormat{within(sound->at(0), kSlowestSound, kFastestSound),
                             within(sound->at(1), 1, kMostChannels),
                             within(sound->at(2), 0, AV_SAMPLE_FMT_NB - 1)};
      }
    } catch (const std::exception&) {
      throw_nonsense(wrong);
    }
  }

  /// What has a place in the world's time, or was due by it, has come by now.
  [[nodiscard]] std::int64_t latest_ns() const { return unpaced_ ? beyond(kLongestHoleNs) : clock_.now_ns(); }

  /// So long behind the last picture; as FfmpegSource, which follows no long hole to beyond what a film may
  /// last.
  [[nodiscard]] std::int64_t beyond(std::int64_t hole_ns) const {
    const std::int64_t last_ns = std::max<std::int64_t>(last_time_ns_, 0);
    return std::max(last_ns + kLongestPacedHoleNs, std::min(last_ns + hole_ns, kLongestFilmNs));
  }

  TimedFrame picture_of(ByteView body) {
    PictureMessage message;
    if (body.size() != sizeof message) throw_nonsense();
    std::memcpy(&message, body.data(), sizeof message);
    TimedFrame timed;
    try {
      timed.frame = pictures_->borrow(message.note);
    } catch (const Error&) {
      throw_nonsense();
    }
    timed.time_ns = std::clamp(message.time_ns, last_time_ns_ + 1, std::max(latest_ns(), last_time_ns_ + 1));
    timed.lost_before = std::min(message.lost_before, kMostLost);
    timed.lost_on_the_way = message.lost_on_the_way != 0;
    if (message.time_break == static_cast<std::uint32_t>(TimeBreak::kBack) ||
        message.time_break == static_cast<std::uint32_t>(TimeBreak::kAhead))
      timed.time_break = static_cast<TimeBreak>(message.time_break);
    timed.treatment = treatment_;
    if (message.turn <= static_cast<std::uint32_t>(kLastTurn)) {
      timed.treatment.turn = static_cast<Turn>(message.turn);
      timed.treatment.is_turned = message.is_turned != 0;
    }
    last_time_ns_ = timed.time_ns;
    return timed;
  }

  TimedFrame sound_of(ByteView body) {
    SoundMessage message;
    if (body.size() < sizeof message) throw_nonsense();
    std::memcpy(&message, body.data(), sizeof message);
    body = body.subspan(sizeof message);
    if (message.sample_rate < kSlowestSound || message.sample_rate > kFastestSound || message.channels < 1 ||
        message.channels > kMostChannels || message.samples < 1 ||
        message.samples > message.sample_rate * kLongestSoundSeconds || message.sample_format < 0 ||
        message.sample_format >= AV_SAMPLE_FMT_NB) {
      throw_nonsense();
    }
    const auto format = static_cast<AVSampleFormat>(message.sample_format);
    const bool planar = av_sample_fmt_is_planar(format) != 0;
    const auto planes = static_cast<std::size_t>(planar ? message.channels : 1);
    const auto bytes = static_cast<std::size_t>(av_get_bytes_per_sample(format)) *
                       static_cast<std::size_t>(message.samples) *
                       static_cast<std::size_t>(planar ? 1 : message.channels);
    // Before memory is asked for.
    if (body.size() != planes * bytes) throw_nonsense();
    TimedFrame timed;
    timed.is_sound = true;
    // A film's sound may lie before its pictures are due.
    const std::int64_t latest =
        live_ ? clock_.now_ns() : beyond(unpaced_ ? kLongestHoleNs : kLongestPacedHoleNs);
    timed.time_ns = std::clamp<std::int64_t>(message.time_ns, 0, std::max<std::int64_t>(latest, 0));
    timed.frame = media::make_frame();
    AVFrame& frame = *timed.frame;
    frame.sample_rate = message.sample_rate;
    frame.format = message.sample_format;
    frame.nb_samples = message.samples;
    av_channel_layout_default(&frame.ch_layout, message.channels);
    require(av_frame_get_buffer(&frame, 0), "take the sound of " + name_);
    for (std::size_t plane = 0; plane < planes; ++plane)
      std::memcpy(frame.extended_data[plane], body.data() + plane * bytes, bytes);
    return timed;
  }

  const CaseClock& clock_;
  Pulse* const pulse_;  // may be null
  const nanoseconds silence_;
  const std::string name_;
  const bool live_, unpaced_;
  const bool polite_;
  const Descriptor memory_;
  const std::shared_ptr<media::PictureBorrower> pictures_;
  media::BoxedChild child_;
  PictureFormat format_;
  Rational rate_;
  std::optional<SoundFormat> sound_;
  bool lives_ = false, begun_ = false;
  SourceCoding coding_;
  std::string input_, remark_;
  PictureTreatment treatment_;
  std::int64_t last_time_ns_ = -1;
};

// Set once, and never cleared: what boxed once is never given up for a decoder without a box.
std::atomic<bool> boxes_are_there = false;

}  // namespace

std::string why_unboxed(Pulse* pulse) {
  if (boxes_are_there) return {};
  std::string why = media::why_no_box([pulse] {
    if (pulse != nullptr) ++*pulse;
  });
  if (why.empty()) boxes_are_there = true;
  return why;
}

std::unique_ptr<Source> open_captured_source(const SourceAddress& address, const CaseClock& clock,
                                             const OpeningTerms& terms) {
  const std::string why = why_unboxed(terms.pulse);
  if (why.empty()) return open_boxed_source(address, clock, terms);
  OpeningTerms unboxed = terms;
  unboxed.remark = "source '" + address.stated + "' is decoded without a box, beside the device key: " + why;
  return open_ffmpeg_source(address, clock, unboxed);
}

std::unique_ptr<Source> open_boxed_source(const SourceAddress& address, const CaseClock& clock,
                                          const OpeningTerms& terms) {
  return std::make_unique<BoxedSource>(address, clock, terms);
}

}  // namespace kiroku::recorder
