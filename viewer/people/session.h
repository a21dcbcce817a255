// Who has signed in. All classes are thread-safe.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "base/clock.h"
#include "base/utc_time.h"
#include "crypto/age_recipient.h"
#include "viewer/http/role.h"

namespace kiroku::viewer {

class Invitation;
class SubjectShelf;

/// A user as Session::person() has one.
std::string person_of(const std::string& user);

/// One person's stay, from signing in to signing out or its end.
class Session {
 public:
  using Identities = std::shared_ptr<const crypto::AgeIdentities>;

  Session(std::string user, Role role, std::optional<UtcTime> credential, Clock::Time ends_at_latest,
          std::shared_ptr<Invitation> invitation = nullptr, bool must_change_password = false,
          const Clock& clock = Clock::system());

  [[nodiscard]] const std::string& user() const { return user_; }
  [[nodiscard]] Role role() const { return role_; }
  /// By what this person is counted: a user by name, a guest by invitation, since guests are called what
  /// their inviters like. No two persons have the same.
  [[nodiscard]] std::string person() const;
  /// User::changed of the user who signed in; nothing for who needed no password.
  [[nodiscard]] std::optional<UtcTime> credential() const { return credential_; }
  /// Whoever came by a one-time password may do nothing but choose another (Route::before_own_password).
  [[nodiscard]] bool must_change_password() const { return must_change_password_; }
  /// By which a guest came; null for everybody else.
  [[nodiscard]] const std::shared_ptr<Invitation>& invitation() const { return invitation_; }
  /// What opens recordings for this session, or null. Keys lie in locked memory (crypto/secret.h), which is
  /// zeroised when the session and the last request that uses them have let go.
  [[nodiscard]] Identities identities() const;
  /// What was read of sealed subjects with these identities, kept exactly as long as they are; null while
  /// locked.
  [[nodiscard]] std::shared_ptr<SubjectShelf> subjects() const;
  void unlock(Identities identities);
  void lock();
  /// Calls `action` unless it succeeded with this text before; who asks meanwhile waits for it. For what is
  /// entered into the appliance log once a session.
  void once(const std::string& deed, const std::function<void()>& action);
  /// After signing out or expiry. What lasts longer than a request (live pictures) must look now and then.
  [[nodiscard]] bool has_ended() const { return ended_ || clock_.now() >= ends_at_latest_; }
  void end();

 private:
  friend class SessionStore;
  const std::string user_;
  const Role role_;
  const std::optional<UtcTime> credential_;
  const Clock::Time ends_at_latest_;
  const std::shared_ptr<Invitation> invitation_;
  const bool must_change_password_;
  const Clock& clock_;
  std::atomic<bool> ended_{false};
  std::atomic<Clock::Duration::rep> last_activity_;
  mutable std::mutex mutex_;
  Identities identities_;
  std::shared_ptr<SubjectShelf> subjects_;  // null without identities
  std::mutex deeds_mutex_;
  std::set<std::string> deeds_;
};

struct SessionLimits {
  std::chrono::seconds idle = std::chrono::minutes(30);
  std::chrono::seconds longest = std::chrono::hours(12);
  /// Of one person; one more ends the one that was idle longest.
  std::size_t most_of_person = 16;
};

class SessionStore {
 public:
  /// `clock` outlives the store and its sessions.
  explicit SessionStore(SessionLimits limits = {}, const Clock& clock = Clock::system());

  struct Opened {
    std::string token;  // 43 characters of base64url: 256 random bits
    std::shared_ptr<Session> session;
  };
  Opened open(const std::string& user, Role role, std::optional<UtcTime> credential,
              bool must_change_password = false);
  /// For a guest, until `ends_at` and however little they do.
  Opened open_for_guest(const std::string& name, std::shared_ptr<Invitation> invitation, Clock::Time ends_at);
  /// Null for a token that no living session has.
  [[nodiscard]] std::shared_ptr<Session> find(std::string_view token, bool is_activity);
  /// A deed that came by no request of its own.
  static void note_activity(Session& session);
  /// How long it lives if nothing is done.
  [[nodiscard]] std::chrono::seconds left(const Session& session) const;
  void close(std::string_view token);
  /// Of a user who was removed, or has another password or role.
  void close_all_of(const std::string& user);
  /// Ends what has expired, and what `is_void` says; to be called now and then.
  void sweep(const std::function<bool(const Session&)>& is_void);

 private:
  Opened add(std::shared_ptr<Session> session);
  [[nodiscard]] bool has_expired(const Session& session, Clock::Time now) const;
  const SessionLimits limits_;
  const Clock& clock_;
  mutable std::mutex mutex_;
  /// By SHA-256 of the token in hex, so that looking one up tells nothing by its time.
  std::unordered_map<std::string, std::shared_ptr<Session>> sessions_;
};

/// 256 random bits as 43 characters that need no escape anywhere.
std::string random_token();

}  // namespace kiroku::viewer
