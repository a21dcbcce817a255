#include "media/box/boxed_jobs.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <sys/mman.h>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/foreign_json.h"
#include "base/printable.h"
#include "crypto/age_error.h"
#include "media/box/job_messages.h"
#include "media/segment_input.h"

namespace kiroku::media {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::steady_clock;

constexpr milliseconds kStep{100};
/// A process is started and its libraries loaded meanwhile, also on a machine that is busy.
constexpr std::chrono::seconds kStarting{60};
constexpr std::chrono::seconds kWorksFor{60};
constexpr std::size_t kLongestMessage = 1 << 20;
constexpr std::size_t kMostOpen = 64, kMostRefused = 64, kMostIdle = 2, kLongestText = 2000;

}  // namespace

/// One job, from its asking to its answer.
class BoxedJobs::Serving {
 public:
  Serving(BoxedJobs& box, const SegmentDoor& door, const std::string& name, const Taker& take,
          const JobBounds& bounds)
      : box_(box), door_(door), name_(name), take_(take), bounds_(bounds) {}

  json run(const std::string& what, const json& with) {
    if (!box_.ready_) await_ready();
    const auto text = [](const json& of) { return of.dump(-1, ' ', false, json::error_handler_t::replace); };
    // Not as an object of both: what goes with it may be the segments of a long case.
    say(ToJobBox::kJob, bytes_of("{\"what\":" + text(what) + ",\"with\":" + text(with) + "}"));
    for (;;) {
      const Channel::Message message = next();
      switch (static_cast<FromJobBox>(message.kind)) {
        case FromJobBox::kOpen:
          answer([&] { open(as<SegmentNumber>(message).number); });
          break;
        case FromJobBox::kRead:
          answer([&] { read(as<SegmentRead>(message)); });
          break;
        case FromJobBox::kClose:
          if (box_.open_.erase(as<SegmentNumber>(message).number) == 0) give_up();
          break;
        case FromJobBox::kBytes:
          // Of nothing there could be more for ever.
          if (message.body.empty() || !is_taken(message.body)) give_up();
          break;
        case FromJobBox::kDone:
          return parsed(message);
        case FromJobBox::kFailed:
          fail(parsed(message));
        default:
          give_up();
      }
    }
  }

 private:
  void say(ToJobBox kind, ByteView body) {
    try {
      box_.child_.channel().send(static_cast<std::uint32_t>(kind), body);
    } catch (const ChannelError&) {
      ended();
    }
  }
  template <typename Form>
  void say_form(ToJobBox kind, const Form& form) {
    say(kind, std::as_bytes(std::span(&form, 1)));
  }

  Channel::Message next() {
    nanoseconds silent{0};
    steady_clock::time_point before = steady_clock::now();
    if (spent_ >= bounds_.whole) too_long();
    for (;;) {
      std::optional<Channel::Message> message;
      try {
        message = box_.child_.channel().receive(kStep, kLongestMessage);
      } catch (const ChannelError&) {
        ended();
      }
      const steady_clock::time_point now = steady_clock::now();
      // Where this thread was kept from running, so was the decoder.
      const nanoseconds waited = std::min<nanoseconds>(now - before, 2 * kStep);
      silent += waited;
      spent_ += waited;
      before = now;
      if (message) return std::move(*message);
      if (spent_ >= bounds_.whole) too_long();
      if (silent >= (box_.ready_ ? box_.silence_ : std::max<milliseconds>(box_.silence_, kStarting))) ended();
    }
  }

  void await_ready() {
    std::string why = "it does not begin";
    try {
      const Channel::Message message = next();
      if (message.kind == static_cast<std::uint32_t>(FromJobBox::kReady)) {
        box_.ready_ = true;
        return;
      }
      if (message.kind == static_cast<std::uint32_t>(FromJobBox::kFailed))
        why = printable(parsed(message).value("text", why).substr(0, kLongestText));
    } catch (const MediaError&) {  // it has seen nothing yet, so that says nothing of the media
    } catch (const json::exception&) {
    }
    box_.ended_ = true;
    throw IoError("start the decoder for", name_ + " (" + why + ")", EPERM);
  }

  [[noreturn]] void ended() {
    box_.ended_ = true;
    const std::string how = box_.child_.how_it_ended();
    if (box_.child_.killed_from_outside()) throw IoError("go on decoding", name_, ECANCELED);
    throw MediaError("the media of " + name_ + " cannot be decoded: the decoder " + how);
  }
  [[noreturn]] void too_long() {
    box_.ended_ = true;
    box_.child_.end();
    throw MediaError("the media of " + name_ + " cannot be decoded: the decoder takes too long");
  }
  [[noreturn]] void give_up() {
    box_.ended_ = true;
    box_.child_.end();
    throw MediaError("the media of " + name_ + " cannot be decoded: the decoder says what it may not");
  }

  bool is_taken(ByteView bytes) {
    try {
      return take_ && take_(bytes);
    } catch (...) {
      box_.ended_ = true;
      box_.child_.end();
      throw;
    }
  }

  template <typename Form>
  Form as(const Channel::Message& message) {
    Form form;
    if (message.body.size() != sizeof form) give_up();
    std::memcpy(&form, message.body.data(), sizeof form);
    return form;
  }
  json parsed(const Channel::Message& message) {
    json value = parse_foreign_json(text_of(message.body));
    if (!value.is_object()) give_up();
    return value;
  }

  template <typename Call>
  void answer(const Call& call) {
    const Clock::Time begin = bounds_.clock->now();
    answer_or_refuse(call);
    spent_ += bounds_.clock->now() - begin;
  }
  template <typename Call>
  void answer_or_refuse(const Call& call) {
    try {
      call();
    } catch (const crypto::AgeError& error) {
      refuse(kAgeFailure, error);
    } catch (const MediaError& error) {
      if (box_.ended_) throw;
      refuse(kMediaFailure, error);
    } catch (const UsageError& error) {
      refuse(kUsageFailure, error);
    } catch (const std::exception& error) {
      if (box_.ended_) throw;
      refuse(kOtherFailure, error);
    }
  }
  void refuse(const char* kind, const std::exception& error) {
    // Each names another segment: a job that meets so many faults has ended long before.
    if (refused_.size() >= kMostRefused) give_up();
    refused_[error.what()] = std::current_exception();
    const json text{{"kind", kind}, {"text", error.what()}};
    say(ToJobBox::kRefused, bytes_of(text.dump(-1, ' ', false, json::error_handler_t::replace)));
  }

  void open(std::uint64_t number) {
    if (box_.open_.size() >= kMostOpen) give_up();
    std::unique_ptr<crypto::ByteSource> source = door_(number);
    const SegmentSize opened{++box_.last_handle_, source->size()};
    box_.open_[opened.handle] = std::move(source);
    say_form(ToJobBox::kOpened, opened);
  }
  void read(const SegmentRead& asked) {
    const auto found = box_.open_.find(asked.handle);
    if (found == box_.open_.end() || asked.bytes > kWindowBytes) give_up();
    const SegmentCount count{
        found->second->read_at(asked.offset, std::span(box_.window_.data(), asked.bytes))};
    say_form(ToJobBox::kRead, count);
  }

  [[noreturn]] void fail(const json& failure) {
    std::string kind, text;
    try {
      kind = failure.at("kind");
      text = failure.at("text");
    } catch (const json::exception&) {
      give_up();
    }
    if (const auto found = refused_.find(text); found != refused_.end())
      std::rethrow_exception(found->second);
    text = printable(text.substr(0, kLongestText));
    if (kind == kMediaFailure) throw MediaError(text);
    if (kind == kUsageFailure) throw UsageError(text);
    throw Error(text);
  }

  BoxedJobs& box_;
  const SegmentDoor& door_;
  const std::string& name_;
  const Taker& take_;
  const JobBounds& bounds_;
  nanoseconds spent_{0};
  std::map<std::string, std::exception_ptr> refused_;  // by what was said
};

BoxedJobs::BoxedJobs(milliseconds silence, const std::string& role)
    : silence_(silence),
      memory_(make_shared_memory(kWindowBytes)),
      window_(memory_.number(), kWindowBytes, PROT_READ | PROT_WRITE),
      child_(role, memory_) {}

BoxedJobs::~BoxedJobs() = default;

json BoxedJobs::ask(const std::string& what, const json& with, const SegmentDoor& door,
                    const std::string& name, Bytes* bytes, const JobBounds& bounds) {
  if (bytes == nullptr) return ask(what, with, door, name, Taker(), bounds);
  const auto take = [bytes, most = bounds.bytes](ByteView more) {
    if (bytes->size() + more.size() > most) return false;
    append(*bytes, more);
    return true;
  };
  return ask(what, with, door, name, take, bounds);
}

json BoxedJobs::ask(const std::string& what, const json& with, const SegmentDoor& door,
                    const std::string& name, const Taker& take, const JobBounds& bounds) {
  return Serving(*this, door, name, take, bounds).run(what, with);
}

bool BoxedJobs::is_spent() const { return ended_ || child_.processor_time() > kWorksFor; }

std::unique_ptr<BoxedJobs> BoxPool::take() {
  {
    const std::lock_guard guard(mutex_);
    if (!idle_.empty()) {
      std::unique_ptr<BoxedJobs> box = std::move(idle_.back());
      idle_.pop_back();
      return box;
    }
  }
  auto box = std::make_unique<BoxedJobs>();
  if (prepare_) prepare_(*box);
  return box;
}

void BoxPool::give_back(std::unique_ptr<BoxedJobs> box) {
  if (box->is_spent()) return;
  const std::lock_guard guard(mutex_);
  if (idle_.size() < kMostIdle) idle_.push_back(std::move(box));
}

}  // namespace kiroku::media
