// Which case a room records, on the disk beside the cases: `<archive>/.running/<room>.json`. It tells a
// recorder that was cut off whose case it was, whether anybody wanted it ended, and whom it was about by
// then. It is no evidence. Thread-safe.
#pragma once

#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>

#include "archive/storage/file_system.h"
#include "base/bytes.h"
#include "crypto/signing_key.h"

namespace kiroku::recorder {

/// Whom a case is about by now, where that became known, or was corrected, while it ran: among the case's
/// events, which a recorder cannot open, and here once more as a subject file. The device signs it, so that
/// nobody who can write the archive chooses whom an operation goes on with.
struct NewestSubject {
  std::string case_id;
  Bytes sealed;
  Bytes signature;
};
NewestSubject sign_newest_subject(std::string case_id, Bytes sealed, const crypto::SigningKey& key);
bool is_signed(const NewestSubject& subject, const crypto::Ed25519PublicKey& key);

struct RunningCase {
  std::string case_id;
  std::string carries_on;  // the case that it carries on; "": none
  std::string reason;      // why the operation's first case was begun: "operator", "schedule", …
  bool ending = false;     // somebody, or a rule, wanted it ended
  /// Of this case, or of the one that it carries on; nothing: that of the beginning is the newest. One that
  /// cannot be read has no signature.
  std::optional<NewestSubject> subject = {};
  /// How long the machine had been suspended since its boot when the case was begun (CLOCK_BOOTTIME less
  /// CLOCK_MONOTONIC). Nothing in a note of an earlier version.
  std::optional<std::chrono::nanoseconds> suspended = {};
};

class RunningNote {
 public:
  /// `files` must outlive the object. The folder is made when something is written.
  RunningNote(archive::FileSystem& files, const std::filesystem::path& archive, std::string room);

  /// Nothing where there is none, or none that can be read.
  [[nodiscard]] std::optional<RunningCase> read() const;
  /// Each is durable when it returns; they throw kiroku::IoError. Before a case is made; the newest subject
  /// of the case that it carries on is kept, since it may not come to be:
  void begins(const RunningCase& running);
  /// While that case runs. Of another case nothing is changed.
  void newest_subject(const NewestSubject& subject);
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
