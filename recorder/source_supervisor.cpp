#include "recorder/source_supervisor.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kFirstReopenPauseNs = 1'000'000'000;
constexpr std::int64_t kLongestReopenPauseNs = 16'000'000'000;
constexpr std::chrono::seconds kPipePatience{10};

}  // namespace

SourceSupervisor::SourceSupervisor(const LaneContext& context, Terms terms, std::unique_ptr<Source> source,
                                   FrameQueue& queue, std::unique_ptr<Source> microphone)
    : context_(context), terms_(std::move(terms)), queue_(queue), source_(std::move(source)) {
  if (source_) {
    input_ = source_->input();
    unboxed_ = source_->is_unboxed();
    stated_ = source_->treatment();
  }
  if (terms_.microphone) {
    microphone_ = std::make_unique<Microphone>(
        *terms_.microphone, context_.clock, terms_.microphone_guard, std::move(microphone),
        Microphone::Listener{
            .take = [this](TimedFrame audio) { hear_of_microphone(std::move(audio)); },
            .lost = [this](archive::GapCause cause) { queue_.push(AudioLost{cause}); },
            .tell = [this](const std::string& sentence) { context_.problems.report(sentence); }});
  }
}

SourceSupervisor::~SourceSupervisor() {
  stop();
  join();
}

void SourceSupervisor::start() {
  thread_ = std::thread([this] { run(); });
  if (microphone_) microphone_->start();
}

void SourceSupervisor::stop() {
  stopping_ = true;
  if (microphone_) microphone_->stop();
  const std::lock_guard guard(mutex_);
  if (source_) source_->interrupt();
}

void SourceSupervisor::join() {
  if (thread_.joinable()) thread_.join();
  if (microphone_) microphone_->join();
}

void SourceSupervisor::show(TimedFrame picture) {
  const bool patient = terms_.address.unpaced();
  for (FrameQueue* each : further_) {
    TimedFrame same{media::reference(*picture.frame), picture.time_ns, picture.lost_before,
                    picture.lost_on_the_way, picture.rate};
    each->push(std::move(same), patient);
  }
  queue_.push(std::move(picture), patient);
}

void SourceSupervisor::lose() {
  const SourceLost lost{cause_of_loss(), context_.clock.now_ns()};
  queue_.push(lost);
  for (FrameQueue* each : further_) each->push(lost);
}

void SourceSupervisor::hear(TimedFrame audio) {
  if (audio.time_ns < 0) return;  // taken before the case clock began
  if (context_.end_ns && audio.time_ns >= *context_.end_ns) return;
  queue_.push(std::move(audio), terms_.address.unpaced());
}

void SourceSupervisor::hear_of_microphone(TimedFrame audio) {
  if (audio.time_ns < 0) return;  // taken before the case clock began
  if (context_.end_ns && audio.time_ns >= *context_.end_ns) return;
  const bool taken = queue_.push(std::move(audio), false);
  if (!taken && !microphone_dropped_) queue_.push(AudioLost{archive::GapCause::kOverload});
  microphone_dropped_ = !taken;
}

unsigned SourceSupervisor::stuck() const {
  return terms_.guard->stuck() + (terms_.microphone ? terms_.microphone_guard->stuck() : 0);
}

std::uint64_t SourceSupervisor::given_up() const {
  return terms_.guard->given_up() + (terms_.microphone ? terms_.microphone_guard->given_up() : 0);
}

std::string SourceSupervisor::input() const {
  const std::lock_guard guard(mutex_);
  return input_;
}

void SourceSupervisor::run() {
  bool present = source_ != nullptr;
  if (!present) {
    lose();
    present = reopen(false);
  }
  const bool comes_back = present && source_->is_live();
  while (present && !stopping_) {
    bool lost = false, decoder_lost = false, silent = false;
    try {
      read(*source_);
    } catch (const SourceSilent& error) {
      context_.problems.report(error.what());
      lost = silent = true;
    } catch (const DecoderLost& error) {
      context_.problems.report(error.what());
      lost = decoder_lost = true;
    } catch (const std::exception& error) {
      context_.problems.report(error.what());
      lost = true;
    }
    live_ = false;
    // What a source throws while it is being stopped is no loss, and a damaged file does not come back.
    const bool ends = stopping_;
    if (!lost || !comes_back || (ends && !silent)) break;
    lose();
    if (ends) break;
    // Full teardown, a pause, and a fresh one: stale buffers and half-open connections go with the old
    // object.
    close();
    present = reopen(!decoder_lost);
  }
  ended_ = true;
  queue_.finish();
  for (FrameQueue* each : further_) each->finish();
  close();
}

void SourceSupervisor::read(Source& source) {
  const Rational rate = source.frame_rate();
  while (std::optional<TimedFrame> frame = source.read()) {
    if (frame->is_sound) {
      hear(std::move(*frame));
      continue;
    }
    if (context_.end_ns && frame->time_ns >= *context_.end_ns) {
      reached_end_ = true;
      return;
    }
    live_ = true;
    frame->rate = rate;
    tell_of(frame->time_break);
    tell_of_turn(*frame);
    if (terms_.tap) terms_.tap->offer(*frame);
    show(std::move(*frame));
  }
}

void SourceSupervisor::tell_of(TimeBreak time_break) {
  if (time_break == TimeBreak::kNone || std::exchange(told_of_break_, true)) return;
  context_.problems.report(
      "source '" + terms_.address.stated + "': its times " +
      (time_break == TimeBreak::kBack ? "go back" : "go further ahead than is followed") +
      "; a gap is stated there, and how long it was is not known");
}

void SourceSupervisor::tell_of_turn(const TimedFrame& picture) {
  if (are_shown_alike(picture.treatment, stated_)) return;
  stated_ = picture.treatment;
  if (!terms_.turned || turns_ == kMostTurns) return;
  std::string how = turn_text(stated_);
  if (how.empty()) how = "its pictures are recorded as they are coded, and it says nothing else any more";
  if (++turns_ == kMostTurns) how += "; further changes are not told";
  char seconds[32];
  std::snprintf(seconds, sizeof seconds, "%.3f s", static_cast<double>(picture.time_ns) * 1e-9);
  terms_.turned("source '" + terms_.address.stated + "', from " + seconds +
                " of the case's clock on: " + how);
}

bool SourceSupervisor::reopen(bool may_have_ended) {
  bool may_end = may_have_ended && terms_.address.kind == SourceKind::kPipe;
  for (std::int64_t pause_ns = kFirstReopenPauseNs;;
       pause_ns = std::min(2 * pause_ns, kLongestReopenPauseNs)) {
    if (!may_end && !wait_until(context_.clock, context_.clock.now_ns() + pause_ns, stopping_)) return false;
    try {
      std::unique_ptr<Source> fresh = open_anew();
      if (const std::string remark = fresh->remark(); !remark.empty()) context_.problems.report(remark);
      const std::lock_guard guard(mutex_);
      input_ = fresh->input();
      unboxed_ = fresh->is_unboxed();
      source_ = std::move(fresh);
      if (stopping_) source_->interrupt();
      return true;
    } catch (const DecoderLost& error) {
      if (stopping_) return false;
      may_end = false;
      context_.problems.report(error.what());
    } catch (const std::exception& error) {
      if (stopping_ || may_end) return false;
      context_.problems.report(error.what());
    }
  }
}

std::unique_ptr<Source> SourceSupervisor::open_anew() {
  OpeningTerms terms;
  terms.cancelled = &stopping_;
  terms.sound = terms_.audio && !terms_.microphone;
  terms.guard = terms_.guard;
  if (terms_.address.kind == SourceKind::kPipe) terms.patience = kPipePatience;
  return open_source(terms_.address, context_.clock, terms);
}

void SourceSupervisor::close() {
  std::unique_ptr<Source> closing;
  {
    const std::lock_guard guard(mutex_);
    closing = std::move(source_);
  }
  // Closing may take its time; stop() must not wait for it.
  closing.reset();
}

archive::GapCause SourceSupervisor::cause_of_loss() const {
  const SourceAddress& address = terms_.address;
  std::error_code ignored;
  const bool unplugged =
      address.kind == SourceKind::kDevice && !std::filesystem::exists(address.location, ignored);
  return unplugged ? archive::GapCause::kDeviceRemoved : archive::GapCause::kSignalLost;
}

}  // namespace kiroku::recorder
