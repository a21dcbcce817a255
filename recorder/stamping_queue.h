// Which checkpoints still want a token, in SQLite, so that a case which ended while the network was down gets
// its time-stamp later, and when each authority may be asked again, so that a new start of the program does
// not ask sooner. Thread-safe; other processes may use the same file.
//
// The cases themselves are the truth: who loses this file loses the reminders, and `kiroku stamp CASE` brings
// one back.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/utc_time.h"

namespace kiroku::recorder {

/// One authority's token is wanted over one case's newest checkpoint.
struct WantedToken {
  std::string case_id;
  std::string authority;
  std::uint64_t checkpoint = 0;  // tree size; a token over a larger one will do as well
  UtcTime since;                 // when a token was first wanted and did not come
  std::uint64_t attempts = 0;    // requests that failed since
  std::string last_error;        // of the latest one, "" if there was none
};

/// What is remembered of an authority. Times are of the wall clock and only mean anything together: after a
/// restart what remains of a pause is reckoned from `written`, and never longer than it was then.
struct AuthorityRecord {
  unsigned failures = 0;  // in a row
  UtcTime written;
  UtcTime limit, next;  // BackOff::limit() and next()
  std::string path;     // over which the latest answer came
  std::string last_error;
  std::optional<UtcTime> last_token;  // when it came
};

/// Every function throws kiroku::Error where the file cannot be used.
class StampingQueue {
 public:
  /// Opens or makes the file; a damaged one is set aside as .damaged and made anew. One of a newer version is
  /// refused.
  static std::unique_ptr<StampingQueue> open(const std::filesystem::path& file);
  ~StampingQueue();

  /// A newer checkpoint of a case takes the place of the older one: it covers it.
  void want(const std::string& case_id, const std::string& authority, std::uint64_t checkpoint, UtcTime now);
  void failed(const std::string& case_id, const std::string& authority, const std::string& error);
  /// A token over this checkpoint is in the ledger; nothing happens if a newer one is wanted meanwhile.
  void done(const std::string& case_id, const std::string& authority, std::uint64_t checkpoint);
  /// Nothing is wanted any more.
  void drop(const std::string& case_id, const std::string& authority);
  /// Longest wanted first.
  [[nodiscard]] std::vector<WantedToken> list() const;

  [[nodiscard]] std::optional<AuthorityRecord> authority(const std::string& name) const;
  void remember(const std::string& name, const AuthorityRecord& record);

 private:
  struct State;
  explicit StampingQueue(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
