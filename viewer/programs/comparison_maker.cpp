#include "viewer/programs/comparison_maker.h"

#include <atomic>
#include <mutex>
#include <thread>
#include <utility>

#include "viewer/kept/kept_comparison.h"

namespace kiroku::viewer {

namespace fs = std::filesystem;

struct ComparisonMaker::Work {
  explicit Work(Options asked) : options(std::move(asked)) {}

  void run(ComparisonJob job) {
    ComparisonProgramEnd end;
    try {
      ComparisonProgramCall call{
          .arguments = {job.case_id, job.seal_file.string(), "--home", options.home.string(), "--by-hand",
                        "-", "--name", job.name, "--made-by", job.made_by, "--asked-by", job.asked_by,
                        "--progress", "json", "--json"},
          .input = job.by_hand,
          .further_file = job.further_file,
          .limit = options.limit};
      call.arguments.insert(call.arguments.end(), job.more.begin(), job.more.end());
      end = run_comparison_program(
          options.program, call, *job.identities,
          [&](const std::string& doing, std::optional<double> share) {
            const std::lock_guard guard(mutex);
            latest->doing = doing;
            latest->share = share;
          },
          stopping);
    } catch (const std::exception& error) {
      end.status = -1;
      end.problem = error.what();
    }
    // 3: made, and no authority time-stamped it; the list says so.
    constexpr int kMade = 0, kMadeWithoutTimeStamp = 3;
    const bool made = end.status == kMade || end.status == kMadeWithoutTimeStamp;
    if (!made) clear(job);
    const std::lock_guard guard(mutex);
    latest->state = made ? ComparisonMakingState::State::kDone : ComparisonMakingState::State::kFailed;
    if (made) return;
    latest->problem = stopping              ? "it was stopped"
                      : end.overdue         ? "it took too long and was ended"
                      : end.problem.empty() ? "the program that compares ended without a word"
                                            : end.problem;
    options.tell("the comparison '" + job.name + "' of case " + job.case_id +
                 " was not made: " + latest->problem);
  }

  /// A program that is killed cannot clear away the plan's film.
  void clear(const ComparisonJob& job) const {
    const compare::KeptPlace place = compare::kept_place(options.comparisons, job.case_id, job.name);
    std::error_code ignored;
    fs::remove_all(place.making(), ignored);
    if (fs::exists(place.sealed_document(), ignored)) return;
    for (const fs::path& film : {place.sealed_replay(), place.sealed_radiographs()})
      fs::remove(film, ignored);
  }

  const Options options;
  mutable std::mutex mutex;
  std::optional<ComparisonMakingState> latest;
  std::atomic<bool> stopping{false};
  std::mutex starting;
  std::jthread thread;  // last: uses the rest
};

ComparisonMaker::ComparisonMaker(Options options) : work_(std::make_unique<Work>(std::move(options))) {}

ComparisonMaker::~ComparisonMaker() { stop(); }

bool ComparisonMaker::start(ComparisonJob job) {
  const std::lock_guard turn(work_->starting);
  {
    const std::lock_guard guard(work_->mutex);
    if (work_->latest && work_->latest->state == ComparisonMakingState::State::kRunning) return false;
    work_->latest = ComparisonMakingState{};
    work_->latest->case_id = job.case_id;
    work_->latest->name = job.name;
    work_->latest->made_by = job.made_by;
  }
  work_->stopping = false;
  work_->thread = std::jthread([this, its = std::move(job)] { work_->run(its); });
  return true;
}

std::optional<ComparisonMakingState> ComparisonMaker::state() const {
  const std::lock_guard guard(work_->mutex);
  return work_->latest;
}

void ComparisonMaker::stop() {
  const std::lock_guard turn(work_->starting);
  work_->stopping = true;
  if (work_->thread.joinable()) work_->thread.join();
}

}  // namespace kiroku::viewer
