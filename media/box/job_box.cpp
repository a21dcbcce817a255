#include "media/box/job_box.h"

#include <algorithm>
#include <cstring>
#include <sys/mman.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "crypto/age_error.h"
#include "media/box/child.h"
#include "media/box/job_messages.h"
#include "media/box/sandbox.h"
#include "media/segment_input.h"

namespace kiroku::media {
namespace {

using nlohmann::json;

constexpr std::chrono::hours kNoLimit{1000};
constexpr std::size_t kLongestRequest = std::size_t{64} << 20;  // the segments of a long case
constexpr std::size_t kBytesAtOnce = 256 * 1024;

class JobBox : public JobSegments {
 public:
  JobBox()
      : channel_(Descriptor(kChannelDescriptor)),
        window_(kMemoryDescriptor, kWindowBytes, PROT_READ | PROT_WRITE) {}

  void run(const Jobs& jobs) {
    say(FromJobBox::kReady, {});
    for (;;) {
      const Channel::Message message = next();
      if (message.kind != static_cast<std::uint32_t>(ToJobBox::kJob)) throw Error("no job");
      const json asked = json::parse(text_of(message.body));
      do_job(jobs, asked.at("what"), asked.at("with"));
    }
  }

  std::unique_ptr<crypto::ByteSource> open(std::uint64_t segment) override;

  void give(ByteView bytes) override {
    for (; !bytes.empty(); bytes = bytes.subspan(std::min(bytes.size(), kBytesAtOnce)))
      say(FromJobBox::kBytes, bytes.first(std::min(bytes.size(), kBytesAtOnce)));
  }

  std::size_t read(std::uint64_t handle, std::uint64_t offset, std::span<std::byte> into) {
    std::size_t done = 0;
    while (done < into.size()) {
      const std::size_t wanted = std::min(into.size() - done, kWindowBytes);
      say_form(FromJobBox::kRead, SegmentRead{handle, offset + done, wanted});
      const auto count = std::min<std::size_t>(answer<SegmentCount>(ToJobBox::kRead).bytes, wanted);
      std::memcpy(into.data() + done, window_.data(), count);
      done += count;
      if (count < wanted) break;
    }
    return done;
  }
  void tell(const char* kind, const std::exception& error) {
    const json failure{{"kind", kind}, {"text", error.what()}};
    say(FromJobBox::kFailed, bytes_of(failure.dump(-1, ' ', false, json::error_handler_t::replace)));
  }
  void close(std::uint64_t handle) { say_form(FromJobBox::kClose, SegmentNumber{handle}); }

 private:
  void say(FromJobBox kind, ByteView body) {
    channel_.send(static_cast<std::uint32_t>(kind), body, kNoLimit);
  }
  template <typename Form>
  void say_form(FromJobBox kind, const Form& form) {
    say(kind, std::as_bytes(std::span(&form, 1)));
  }
  Channel::Message next() {
    for (;;) {
      if (auto message = channel_.receive(kNoLimit, kLongestRequest)) return std::move(*message);
    }
  }
  template <typename Form>
  Form answer(ToJobBox kind) {
    const Channel::Message message = next();
    if (message.kind == static_cast<std::uint32_t>(ToJobBox::kRefused)) {
      const json refused = json::parse(text_of(message.body));
      const std::string what = refused.at("kind"), text = refused.at("text");
      if (what == kAgeFailure) throw crypto::AgeError(crypto::AgeFailure::kPayloadDamaged, text);
      if (what == kMediaFailure) throw MediaError(text);
      if (what == kUsageFailure) throw UsageError(text);
      throw Error(text);
    }
    Form form;
    if (message.kind != static_cast<std::uint32_t>(kind) || message.body.size() != sizeof form)
      throw ChannelError("another answer was expected");
    std::memcpy(&form, message.body.data(), sizeof form);
    return form;
  }

  void do_job(const Jobs& jobs, const std::string& what, const json& with) {
    try {
      const auto found = jobs.find(what);
      if (found == jobs.end()) throw Error("the decoder knows no job '" + what + "'");
      const json answer = found->second(with, *this);
      say(FromJobBox::kDone, bytes_of(answer.dump(-1, ' ', false, json::error_handler_t::replace)));
    } catch (const ChannelError&) {
      throw;
    } catch (const MediaError& error) {
      tell(kMediaFailure, error);
    } catch (const UsageError& error) {
      tell(kUsageFailure, error);
    } catch (const std::exception& error) {
      tell(kOtherFailure, error);
    }
  }

  Channel channel_;
  const Mapping window_;
};

class JobSegment : public crypto::ByteSource {
 public:
  JobSegment(JobBox& box, const SegmentSize& opened) : box_(box), opened_(opened) {}
  ~JobSegment() override {
    try {
      box_.close(opened_.handle);
    } catch (const ChannelError&) {  // then there is nothing to close any more
    }
  }
  JobSegment(const JobSegment&) = delete;
  JobSegment& operator=(const JobSegment&) = delete;
  [[nodiscard]] std::uint64_t size() const override { return opened_.size; }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    return box_.read(opened_.handle, offset, into);
  }

 private:
  JobBox& box_;
  const SegmentSize opened_;
};

std::unique_ptr<crypto::ByteSource> JobBox::open(std::uint64_t segment) {
  say_form(FromJobBox::kOpen, SegmentNumber{segment});
  return std::make_unique<JobSegment>(*this, answer<SegmentSize>(ToJobBox::kOpened));
}

}  // namespace

void run_job_box(const Jobs& jobs, unsigned processor_seconds) {
  try {
    JobBox box;
    try {
      limit_process(processor_seconds);
      close_box(BoxNeeds::kNothing);
    } catch (const Error& error) {
      box.tell(kOtherFailure, error);
      ::_exit(1);
    }
    box.run(jobs);
  } catch (const std::exception&) {  // the other end is gone, or will see that this one is
    ::_exit(1);
  }
  ::_exit(0);
}

}  // namespace kiroku::media
