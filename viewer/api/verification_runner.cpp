#include "viewer/api/verification_runner.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <thread>

#include "base/error.h"
#include "viewer/http/file_stamp.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostWaiting = 64;
constexpr std::size_t kMostRemembered = 256;

/// Of all files of the case: what changes when one is written, replaced, added or removed.
using CaseIdentity = std::map<fs::path, FileStamp>;

CaseIdentity identity_of(const fs::path& folder) {
  CaseIdentity identity;
  std::error_code failed;
  for (fs::recursive_directory_iterator file(folder, failed), end; !failed && file != end;
       file.increment(failed)) {
    std::error_code gone;
    if (fs::is_directory(file->symlink_status(gone))) continue;
    identity[file->path()] = file_stamp(file->path());
  }
  return identity;
}

struct Job {
  VerificationState state;
  CaseIdentity files;  // before they were read
};

}  // namespace

struct VerificationRunner::State {
  explicit State(Options asked) : options(std::move(asked)), thread([this] { run(); }) {}
  ~State() {
    {
      const std::lock_guard guard(mutex);
      stop = true;
    }
    wake.notify_one();
    thread.join();
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void run() {
    std::unique_lock lock(mutex);
    while (true) {
      wake.wait(lock, [this] { return stop || !waiting.empty(); });
      if (stop) return;
      const fs::path folder = waiting.front();
      lock.unlock();
      VerificationState done = verify(folder);
      lock.lock();
      waiting.pop_front();
      jobs[folder].state = std::move(done);
    }
  }

  VerificationState verify(const fs::path& folder) {
    archive::VerifyOptions verify = options.verify;
    verify.progress = [&](std::uint64_t done_bytes, std::uint64_t total_bytes) {
      const std::lock_guard guard(mutex);
      jobs[folder].state.done_bytes = done_bytes;
      jobs[folder].state.total_bytes = total_bytes;
    };
    VerificationState done;
    try {
      auto report = std::make_shared<const archive::VerificationReport>(archive::verify_case(folder, verify));
      if (options.verified) options.verified(folder, *report);
      done.report = std::move(report);
      done.finished = utc_now();
    } catch (const std::exception& error) {
      done.problem = error.what();
    }
    return done;
  }

  const Options options;
  mutable std::mutex mutex;
  std::condition_variable wake;
  std::map<fs::path, Job> jobs;
  std::deque<fs::path> waiting;  // the first one runs
  bool stop = false;
  std::thread thread;  // last: uses the rest
};

VerificationRunner::VerificationRunner(Options options)
    : state_(std::make_unique<State>(std::move(options))) {}
VerificationRunner::~VerificationRunner() = default;

bool VerificationRunner::start(const fs::path& folder) {
  const std::lock_guard guard(state_->mutex);
  if (std::ranges::count(state_->waiting, folder) > 0) return true;
  if (state_->waiting.size() >= kMostWaiting) return false;
  if (state_->jobs.size() >= kMostRemembered) {
    std::erase_if(state_->jobs, [](const auto& each) { return each.second.state.is_done(); });
  }
  state_->jobs[folder] = {{}, identity_of(folder)};
  state_->waiting.push_back(folder);
  state_->wake.notify_one();
  return true;
}

std::optional<VerificationState> VerificationRunner::state(const fs::path& folder) const {
  const std::lock_guard guard(state_->mutex);
  const auto found = state_->jobs.find(folder);
  if (found == state_->jobs.end()) return {};
  const bool is_old = found->second.state.is_done() && found->second.files != identity_of(folder);
  return is_old ? std::nullopt : std::optional(found->second.state);
}

}  // namespace kiroku::viewer
