#include "viewer/api/verification_runner.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <thread>
#include <utility>

#include "archive/format/case_layout.h"
#include "base/error.h"
#include "viewer/api/home_witnesses.h"
#include "viewer/http/file_stamp.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostWaiting = 64, kMostOfPerson = 16;
constexpr std::size_t kMostRemembered = 256;

/// Of all files of the case: what changes when one is written, replaced, added or removed.
using CaseIdentity = std::map<fs::path, FileStamp>;

CaseIdentity identity_of(const fs::path& folder, bool is_elsewhere) {
  CaseIdentity identity;
  if (is_elsewhere) return {{folder / archive::kLedgerFile, file_stamp(folder / archive::kLedgerFile)}};
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

struct Wish {
  fs::path folder;
  std::set<std::string> persons;
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
      const fs::path folder = take_next();
      lock.unlock();
      VerificationState done = verify(folder);
      lock.lock();
      running.clear();
      jobs[folder].state = std::move(done);
    }
  }

  /// With the mutex held: of whoever was served longest ago, what they asked for first.
  fs::path take_next() {
    const auto turn_of = [this](const Wish& wish) {
      std::uint64_t earliest = turn;
      for (const std::string& person : wish.persons) {
        const auto found = served.find(person);
        earliest = std::min(earliest, found == served.end() ? 0 : found->second);
      }
      return earliest;
    };
    const auto next = std::ranges::min_element(waiting, {}, turn_of);
    ++turn;
    for (const std::string& person : next->persons) served[person] = turn;
    running = std::move(next->folder);
    waiting.erase(next);
    return running;
  }

  VerificationState verify(const fs::path& folder) {
    archive::VerifyOptions verify = options.verify;
    verify.progress = [&](std::uint64_t done_bytes, std::uint64_t total_bytes) {
      const std::lock_guard guard(mutex);
      jobs[folder].state.done_bytes = done_bytes;
      jobs[folder].state.total_bytes = total_bytes;
    };
    VerificationState done;
    std::optional<HomeWitnesses> witnesses;
    if (!verify.devices.empty()) witnesses.emplace(options.home, verify.devices.front()).ask_in(verify);
    try {
      auto found = options.elsewhere ? options.elsewhere(folder) : archive::verify_case(folder, verify);
      if (witnesses) witnesses->say(found);
      auto report = std::make_shared<const archive::VerificationReport>(std::move(found));
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
  std::deque<Wish> waiting;
  fs::path running;                             // empty: none
  std::map<std::string, std::uint64_t> served;  // whose last one began when; greater is later
  std::uint64_t turn = 0;
  bool stop = false;
  std::thread thread;  // last: uses the rest
};

VerificationRunner::VerificationRunner(Options options)
    : state_(std::make_unique<State>(std::move(options))) {}
VerificationRunner::~VerificationRunner() = default;

bool VerificationRunner::start(const fs::path& folder, const std::string& person) {
  // A folder may have very many files, and others ask meanwhile.
  CaseIdentity identity = identity_of(folder, state_->options.elsewhere != nullptr);
  const std::lock_guard guard(state_->mutex);
  if (state_->running == folder) return true;
  std::deque<Wish>& waiting = state_->waiting;
  if (waiting.empty() && state_->running.empty()) state_->served.clear();
  if (const auto same = std::ranges::find(waiting, folder, &Wish::folder); same != waiting.end()) {
    same->persons.insert(person);
    return true;
  }
  const auto is_theirs = [&](const Wish& wish) { return wish.persons.contains(person); };
  if (waiting.size() >= kMostWaiting ||
      static_cast<std::size_t>(std::ranges::count_if(waiting, is_theirs)) >= kMostOfPerson)
    return false;
  if (state_->jobs.size() >= kMostRemembered) {
    std::erase_if(state_->jobs, [](const auto& each) { return each.second.state.is_done(); });
  }
  state_->jobs[folder] = {{}, std::move(identity)};
  waiting.push_back({folder, {person}});
  state_->wake.notify_one();
  return true;
}

std::optional<VerificationState> VerificationRunner::state(const fs::path& folder) const {
  std::optional<Job> job;
  {
    const std::lock_guard guard(state_->mutex);
    const auto found = state_->jobs.find(folder);
    if (found == state_->jobs.end()) return {};
    job = found->second;
  }
  const bool is_old =
      job->state.is_done() && job->files != identity_of(folder, state_->options.elsewhere != nullptr);
  return is_old ? std::nullopt : std::optional(job->state);
}

}  // namespace kiroku::viewer
