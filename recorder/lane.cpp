#include "recorder/lane.h"

#include "base/error.h"

namespace kiroku::recorder {

void ProblemLog::report(const std::string& sentence) {
  const std::lock_guard guard(mutex_);
  latest_ = sentence;
}

void ProblemLog::end_session(const std::string& close_reason, const std::string& sentence) {
  const std::lock_guard guard(mutex_);
  latest_ = sentence;
  if (close_reason_.empty()) close_reason_ = close_reason;
}

std::string ProblemLog::latest() const {
  const std::lock_guard guard(mutex_);
  return latest_;
}

std::string ProblemLog::close_reason() const {
  const std::lock_guard guard(mutex_);
  return close_reason_;
}

std::int64_t next_boundary(std::int64_t time_ns, std::chrono::nanoseconds duration) {
  return (time_ns / duration.count() + 1) * duration.count();
}

namespace {

bool is_disk_full(const std::exception& error) {
  const auto* io = dynamic_cast<const IoError*>(&error);
  return io != nullptr && io->disk_full();
}

}  // namespace

archive::GapCause gap_cause_for(const std::exception& error) {
  return is_disk_full(error) ? archive::GapCause::kDiskFull : archive::GapCause::kOverload;
}

std::string close_reason_for(const std::exception& error) {
  return is_disk_full(error) ? "disk-full" : std::string("error: ") + error.what();
}

}  // namespace kiroku::recorder
