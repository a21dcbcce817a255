// One time-stamping authority as this process deals with it: asking, judging what comes, and leaving it alone
// for as long as it or the network demands. Somebody may have the hashes of many stamped by it together; then
// they are asked first, and the authority itself where they are away, late, or give what does not hold.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "archive/writing/case_writer.h"
#include "base/clock.h"
#include "evidence/shared_stamps.h"
#include "recorder/back_off.h"
#include "recorder/stamping_queue.h"
#include "timestamp/client.h"
#include "timestamp/request.h"
#include "timestamp/token_verifier.h"

namespace kiroku::recorder {

struct NamedAuthority {
  std::string name;  // short: [a-z0-9-], as in file names
  std::shared_ptr<timestamp::StampSource> source;
  BackOffPolicy pauses{};
  /// By whom this authority stamps the hashes of many together; null: by nobody.
  std::shared_ptr<evidence::SharedStamps> shared{};
  /// For how long a shared token is waited for before the authority itself is asked.
  std::chrono::nanoseconds shared_patience = std::chrono::seconds(90);
};

/// What an authority said to one checkpoint.
struct AuthorityAnswer {
  archive::StoredCheckpoint checkpoint;
  std::string authority;
  Bytes response;                         // empty if none came
  timestamp::TokenJudgement judgement;    // of the response
  std::string cause;                      // why there is no valid token, "" if there is one
  Clock::Duration asked{0}, answered{0};  // by Clock::since_boot()
  std::string path;        // of a valid token: path() of timestamp::StampSource or evidence::SharedStamps
  std::string not_shared;  // why the authority itself was asked, though a shared token was wanted; else ""
  bool hurried = false;    // the authority itself was asked because nobody waits for a round any more
  std::chrono::nanoseconds pause{0};  // how long the authority is left alone after a failure

  [[nodiscard]] bool valid() const { return cause.empty(); }
};

/// For whoever watches.
struct AuthorityStatus {
  std::string name;
  std::string path;        // over which the latest token came, "" if there is no network between
  unsigned failures = 0;   // in a row, up to the latest token, shared ones too
  std::string last_error;  // of the latest failure, "" after a token
  std::string not_shared;  // why the latest token that was to be shared is none; "" where it is, or no matter
  std::optional<UtcTime> last_token;
  std::chrono::nanoseconds pause{0};  // until it may be asked again
};

/// The entry of a valid answer, but for what CaseWriter::add_token() fills in.
archive::TokenEntry token_facts(const AuthorityAnswer& answer);

class AuthorityContact {
 public:
  using Time = BackOff::Time;

  /// `trust` null: nothing is trusted. With a `queue`, what it remembers of the authority is taken up, and
  /// kept there; a queue that cannot be used is done without. All must outlive the object.
  AuthorityContact(NamedAuthority authority, const timestamp::TrustStore* trust, StampingQueue* queue,
                   const Clock& clock = Clock::system());

  [[nodiscard]] const std::string& name() const { return authority_.name; }
  /// Asks now, whatever limit() and next() say. Used by one thread at a time.
  AuthorityAnswer ask(archive::StoredCheckpoint checkpoint);
  /// Whether a shared token may be waited for: somebody gives them, is not left alone after a failure, and
  /// nobody hurries. What the authority itself demands has no say in it. Thread-safe.
  [[nodiscard]] bool may_share() const;
  /// A valid answer by a shared token, which takes as long as a round: shared_patience at most, and one
  /// request. The authority itself is not asked, and its limits stay as they are. Nothing once hurried, or
  /// where none comes: then whoever should give it is left alone for a while, as an authority is, and the
  /// status says why. What comes counts only if this hash and a nonce that was drawn for it lead to a token
  /// that is trusted. Used by the thread that asks.
  std::optional<AuthorityAnswer> wait_for_shared(const archive::StoredCheckpoint& checkpoint);
  /// As ask(), of a checkpoint that has no shared token: the answer says why.
  AuthorityAnswer ask_in_place_of_sharing(archive::StoredCheckpoint checkpoint);
  /// From now on nobody waits for a round: wait_for_shared(), also one under way, gives nothing. Thread-safe.
  void hurry();
  /// As ask(), over a hash that is no checkpoint's: the answer's is empty.
  AuthorityAnswer ask_over(crypto::HashAlgorithm algorithm, ByteView imprint);
  /// As BackOff says, and what other processes learnt meanwhile. Thread-safe.
  [[nodiscard]] Time limit();
  [[nodiscard]] Time next();
  [[nodiscard]] AuthorityStatus status() const;
  /// Why the authority itself gave no token when it was last asked; "" where it gave one. Thread-safe.
  [[nodiscard]] std::string last_failure() const;

 private:
  AuthorityAnswer ask(const timestamp::Request& request, archive::StoredCheckpoint checkpoint);
  /// Takes over what another process, or an earlier run of the program, has written.
  void catch_up_locked();
  void remember_locked();

  NamedAuthority authority_;
  const timestamp::TrustStore* trust_;
  StampingQueue* queue_;
  const Clock& clock_;
  mutable std::mutex mutex_;  // of what follows
  BackOff back_off_, shared_back_off_;
  AuthorityRecord record_;
  std::string not_shared_;
  bool hurried_ = false;
  bool shared_since_failure_ = false;  // a shared token is younger than the authority's own latest failure
  std::condition_variable hurrying_;
};

}  // namespace kiroku::recorder
