// Guests: who was invited to look on in a room, until when, and what became of it (docs/reference/viewer.md,
// "Invitations"). Kept in memory alone, so that none outlives the program. All classes are thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "base/utc_time.h"
#include "viewer/people/session.h"

namespace kiroku::viewer {

struct InvitationTerms {
  std::string guest;                  // as the inviter calls them
  std::string room;                   // the one whose pictures they see
  std::string made_by;                // the inviter
  std::optional<UtcTime> credential;  // Session::credential() of the inviter
  std::chrono::seconds lasts{0};
};

enum class InvitationState { kOpen, kJoined, kEnded };
std::string_view invitation_state_name(InvitationState state);

/// Why one has ended.
enum class InvitationEnd { kRevoked, kTime, kCase, kLeft, kInviter, kStopped };
std::string_view invitation_end_name(InvitationEnd end);  // "revoked", as openapi.json has it

/// One of them. It is of the case that runs in its room, or of the first that begins there while it lasts: no
/// other can be seen by it.
class Invitation {
 public:
  Invitation(std::string id, InvitationTerms terms, const Clock& clock);

  [[nodiscard]] const std::string& id() const { return id_; }  // eight hexadecimal digits, no secret
  [[nodiscard]] const InvitationTerms& terms() const { return terms_; }
  [[nodiscard]] UtcTime made_at() const { return made_at_; }
  [[nodiscard]] UtcTime ends_at() const { return made_at_ + terms_.lasts; }
  [[nodiscard]] Clock::Time deadline() const { return deadline_; }
  /// Until the deadline; negative after it.
  [[nodiscard]] Clock::Duration left() const { return deadline_ - clock_.now(); }

  struct View {
    InvitationState state = InvitationState::kOpen;
    std::optional<InvitationEnd> end;
    std::string case_id;  // "": none has begun yet
    std::string address;  // of the guest who joined
    bool is_present = false;
  };
  [[nodiscard]] View view() const;
  /// Whether pictures of the case that runs in its room ("": none does) may be seen now.
  bool admits(const std::string& running_case);

  /// A connection of the guest's began, or ended. True where the guest had been said to be gone, and is back.
  bool arrive();
  void depart();
  /// True once after the guest has had no connection for some seconds: to be said.
  bool has_gone();

 private:
  friend class Invitations;
  /// False if it was not open.
  bool join(std::string address);
  void belongs_to(const std::shared_ptr<Session>& session);
  /// False if it has ended before. Ends the guest's session, and with it every connection.
  bool end(InvitationEnd why);
  /// Why it must end now.
  [[nodiscard]] std::optional<InvitationEnd> reason_to_end(const std::string& running_case);
  bool bind(const std::string& running_case);  // with the mutex held

  const std::string id_;
  const InvitationTerms terms_;
  const Clock& clock_;
  const UtcTime made_at_;
  const Clock::Time deadline_;
  mutable std::mutex mutex_;
  View view_;
  std::weak_ptr<Session> session_;  // which holds this
  std::size_t connections_ = 0;
  Clock::Time last_departure_;
  bool said_gone_ = false;
};

class Invitations {
 public:
  static constexpr std::size_t kMostAtOnce = 20;
  using Ended = std::function<void(const Invitation& invitation, InvitationEnd why)>;
  /// `ended` hears of each end that nobody asked for, and of guests that left.
  explicit Invitations(Ended ended, const Clock& clock = Clock::system());

  struct Made {
    std::shared_ptr<Invitation> invitation;
    std::string token;  // 256 random bits; only its hash is kept
  };
  /// Of the case that runs in its room now, if one does. Refusal 409 while kMostAtOnce have not ended.
  Made make(InvitationTerms terms, const std::string& running_case);
  /// Opens the one session that the token is good for. Nothing if the token was never given out, was used, or
  /// its invitation has ended. `enter` is called before: what it throws leaves the invitation as it was.
  std::optional<SessionStore::Opened> join(std::string_view token, const std::string& address,
                                           SessionStore& sessions,
                                           const std::function<void(const Invitation& invitation)>& enter);
  /// False if there is none of this identifier that has not ended.
  bool revoke(std::string_view id);
  /// By the guest.
  void leave(Invitation& invitation);
  /// Those that last, and the newest of those that have ended; newest first.
  [[nodiscard]] std::list<std::shared_ptr<Invitation>> list() const;
  /// Null for an identifier that none has.
  [[nodiscard]] std::shared_ptr<Invitation> find(std::string_view id) const;

  /// Ends those whose time or case is over, or whose inviter `is_void`; to be called now and then, with what
  /// runs in each room.
  void sweep(const std::function<std::string(const std::string& room)>& running_case,
             const std::function<bool(const InvitationTerms&)>& is_void);
  void end_all(InvitationEnd why);

 private:
  void end(Invitation& invitation, InvitationEnd why);

  const Ended ended_;
  const Clock& clock_;
  mutable std::mutex mutex_;
  struct Entry {
    std::string key;  // SHA-256 of the token
    std::shared_ptr<Invitation> invitation;
  };
  std::list<Entry> entries_;  // newest first
};

}  // namespace kiroku::viewer
