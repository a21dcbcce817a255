// Work on archived segments that is done in a box (child.h): whoever made a case may have made it to attack
// who watches it. The box has no key and no file: it asks for plaintext, piece by piece, and this end opens,
// compares and decrypts it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/clock.h"
#include "crypto/byte_source.h"
#include "media/box/child.h"

namespace kiroku::media {

/// The plaintext of a job's segment, by the number that the job knows it by. Throws for a number that there
/// is none of.
using SegmentDoor = std::function<std::unique_ptr<crypto::ByteSource>(std::uint64_t segment)>;

/// What one job may take. A decoder that was taken over gives signs of life for as long as it likes.
struct JobBounds {
  /// From asking to the answer, without the time for which the machine kept this thread from running.
  std::chrono::nanoseconds whole = std::chrono::nanoseconds::max();
  /// Of what it makes beside its answer.
  std::size_t bytes = std::size_t{1} << 30;
  const Clock* clock = &Clock::system();  // by which `whole` passes
};

/// One box. An object belongs to one thread at a time.
class BoxedJobs {
 public:
  /// A decoder that says nothing for `silence` has hung: no picture takes so long to decode, and no piece of
  /// a viewing copy to code. `role` is the program's (apps/kiroku-decoder). Throws kiroku::IoError where
  /// there is no box to be had.
  explicit BoxedJobs(std::chrono::milliseconds silence = std::chrono::seconds(60),
                     const std::string& role = "segments");
  ~BoxedJobs();
  BoxedJobs(const BoxedJobs&) = delete;
  BoxedJobs& operator=(const BoxedJobs&) = delete;

  /// Has `what` done (job_box.h) and gives its answer; what else it makes is added to `bytes`, if that is not
  /// null. `name` stands in errors. Throws what the door threw where that ended the job, else MediaError for
  /// damage and for a decoder that ended or hung over it, kiroku::UsageError, kiroku::Error; kiroku::IoError
  /// where somebody outside killed the decoder. A job beyond its bounds ends with its box, as MediaError. A
  /// box that ended does nothing any more.
  nlohmann::json ask(const std::string& what, const nlohmann::json& with, const SegmentDoor& door,
                     const std::string& name, Bytes* bytes = nullptr, const JobBounds& bounds = {});
  /// Takes a piece of what the box makes; false where that cannot be: then it is killed (MediaError).
  using Taker = std::function<bool(ByteView bytes)>;
  /// The same, for more than memory holds. What `take` throws ends the job, and the box.
  nlohmann::json ask(const std::string& what, const nlohmann::json& with, const SegmentDoor& door,
                     const std::string& name, const Taker& take, const JobBounds& bounds = {});
  /// Whether it is to be replaced before the next job: it ended, or has worked for long.
  [[nodiscard]] bool is_spent() const;
  [[nodiscard]] pid_t process() const { return child_.process(); }

 private:
  class Serving;

  const std::chrono::milliseconds silence_;
  const Descriptor memory_;
  const Mapping window_;
  BoxedChild child_;
  std::map<std::uint64_t, std::unique_ptr<crypto::ByteSource>> open_;
  std::uint64_t last_handle_ = 0;
  bool ready_ = false, ended_ = false;
};

/// Boxes for jobs of one kind of content, such as a case: who was attacked by one part of it could show
/// another part otherwise than it is. Thread-safe.
class BoxPool {
 public:
  /// Called for each new box; may be empty.
  using Prepare = std::function<void(BoxedJobs&)>;
  explicit BoxPool(Prepare prepare = {}) : prepare_(std::move(prepare)) {}

  /// Calls `use` with a box that nobody else uses meanwhile.
  template <typename Use>
  auto with(const Use& use) {
    Lease lease(*this);
    return use(*lease.box);
  }

 private:
  struct Lease {
    explicit Lease(BoxPool& from) : pool(from), box(from.take()) {}
    ~Lease() { pool.give_back(std::move(box)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    BoxPool& pool;
    std::unique_ptr<BoxedJobs> box;
  };
  std::unique_ptr<BoxedJobs> take();
  void give_back(std::unique_ptr<BoxedJobs> box);

  const Prepare prepare_;
  std::mutex mutex_;  // guards what follows
  std::vector<std::unique_ptr<BoxedJobs>> idle_;
};

}  // namespace kiroku::media
