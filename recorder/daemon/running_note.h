// Which case a room records, on the disk beside the cases: `<archive>/.running/<room>.json`. It tells a
// recorder that was cut off whose case it was and whether anybody wanted it ended. It is no evidence: nothing
// in a case depends on it. Thread-safe.
#pragma once

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>

#include "archive/storage/file_system.h"

namespace kiroku::recorder {

struct RunningCase {
  std::string case_id;
  std::string carries_on;  // the case that it carries on; "": none
  std::string reason;      // why the operation's first case was begun: "operator", "schedule", …
  bool ending = false;     // somebody, or a rule, wanted it ended
};

class RunningNote {
 public:
  /// `files` must outlive the object. The folder is made when something is written.
  RunningNote(archive::FileSystem& files, const std::filesystem::path& archive, std::string room);

  /// Nothing where there is none, or none that can be read.
  [[nodiscard]] std::optional<RunningCase> read() const;
  /// Each is durable when it returns; they throw kiroku::IoError. Before a case is made:
  void begins(const RunningCase& running);
  /// Before that case is ended. Of another case nothing is changed.
  void ends(const std::string& case_id);
  /// After that case was closed, unless its operation goes on. Likewise.
  void clear(const std::string& case_id);

 private:
  void write(const RunningCase& running);

  archive::FileSystem& files_;
  const std::filesystem::path file_;
  mutable std::mutex mutex_;
};

}  // namespace kiroku::recorder
