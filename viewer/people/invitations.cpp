#include "viewer/people/invitations.h"

#include <algorithm>
#include <array>
#include <utility>

#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "crypto/secret.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

constexpr std::size_t kIdBytes = 4;
/// Of those that have ended, so many stay in the list.
constexpr std::size_t kMostEnded = 20;
/// A page that is loaded anew, or hidden for a moment, has not gone.
constexpr std::chrono::seconds kGoneAfter{10};

constexpr std::array<std::string_view, 3> kStates{"open", "joined", "ended"};
constexpr std::array<std::string_view, 6> kEnds{"revoked", "time", "case", "left", "inviter", "stopped"};

std::string key_of(std::string_view token) { return crypto::to_hex(crypto::sha256(bytes_of(token))); }

}  // namespace

std::string_view invitation_state_name(InvitationState state) {
  return kStates.at(static_cast<std::size_t>(state));
}

std::string_view invitation_end_name(InvitationEnd end) { return kEnds.at(static_cast<std::size_t>(end)); }

Invitation::Invitation(std::string id, InvitationTerms terms, const Clock& clock)
    : id_(std::move(id)),
      terms_(std::move(terms)),
      clock_(clock),
      made_at_(clock.utc()),
      deadline_(clock.now() + terms_.lasts) {}

Invitation::View Invitation::view() const {
  const std::lock_guard guard(mutex_);
  View view = view_;
  view.is_present = connections_ > 0;
  return view;
}

bool Invitation::bind(const std::string& running_case) {
  if (view_.case_id.empty()) view_.case_id = running_case;
  return view_.case_id == running_case;
}

bool Invitation::admits(const std::string& running_case) {
  const std::lock_guard guard(mutex_);
  return view_.state == InvitationState::kJoined && clock_.now() < deadline_ && !running_case.empty() &&
         bind(running_case);
}

bool Invitation::arrive() {
  const std::lock_guard guard(mutex_);
  ++connections_;
  return std::exchange(said_gone_, false);
}

void Invitation::depart() {
  const std::lock_guard guard(mutex_);
  --connections_;
  last_departure_ = clock_.now();
}

bool Invitation::has_gone() {
  const std::lock_guard guard(mutex_);
  const bool gone = view_.state == InvitationState::kJoined && connections_ == 0 &&
                    clock_.now() - last_departure_ >= kGoneAfter;
  return gone && !std::exchange(said_gone_, true);
}

bool Invitation::join(std::string address) {
  const std::lock_guard guard(mutex_);
  const Clock::Time now = clock_.now();
  if (view_.state != InvitationState::kOpen || now >= deadline_) return false;
  view_.state = InvitationState::kJoined;
  view_.address = std::move(address);
  last_departure_ = now;
  return true;
}

void Invitation::belongs_to(const std::shared_ptr<Session>& session) {
  const std::lock_guard guard(mutex_);
  // Ended between joining and now.
  if (view_.state == InvitationState::kEnded) session->end();
  session_ = session;
}

bool Invitation::end(InvitationEnd why) {
  const std::lock_guard guard(mutex_);
  if (view_.state == InvitationState::kEnded) return false;
  view_.state = InvitationState::kEnded;
  view_.end = why;
  if (const auto session = session_.lock()) session->end();
  return true;
}

std::optional<InvitationEnd> Invitation::reason_to_end(const std::string& running_case) {
  const std::lock_guard guard(mutex_);
  if (view_.state == InvitationState::kEnded) return {};
  if (clock_.now() >= deadline_) return InvitationEnd::kTime;
  if (!bind(running_case)) return InvitationEnd::kCase;
  return {};
}

Invitations::Invitations(Ended ended, const Clock& clock) : ended_(std::move(ended)), clock_(clock) {}

Invitations::Made Invitations::make(InvitationTerms terms, const std::string& running_case) {
  Made made;
  made.token = random_token();
  const crypto::Secret id = crypto::Secret::random(kIdBytes);
  made.invitation = std::make_shared<Invitation>(crypto::to_hex(id.bytes()), std::move(terms), clock_);
  // Nobody knows it yet, so nobody else looks at it.
  made.invitation->view_.case_id = running_case;
  const std::lock_guard guard(mutex_);
  std::size_t lasting = 0, ended = 0;
  std::erase_if(entries_, [&](const Entry& entry) {
    const bool has_ended = entry.invitation->view().state == InvitationState::kEnded;
    ++(has_ended ? ended : lasting);
    return has_ended && ended > kMostEnded;
  });
  if (lasting >= kMostAtOnce) {
    throw Refusal(409, std::to_string(kMostAtOnce) + " invitations have not ended yet: end one first");
  }
  entries_.push_front({key_of(made.token), made.invitation});
  return made;
}

std::optional<SessionStore::Opened> Invitations::join(
    std::string_view token, const std::string& address, SessionStore& sessions,
    const std::function<void(const Invitation& invitation)>& enter) {
  const std::string key = key_of(token);
  std::shared_ptr<Invitation> invitation;
  {
    const std::lock_guard guard(mutex_);
    const auto found = std::ranges::find(entries_, key, &Entry::key);
    if (found == entries_.end() || !found->invitation->join(address)) return {};
    invitation = found->invitation;
  }
  try {
    enter(*invitation);
  } catch (...) {
    // They may come again.
    const std::lock_guard guard(invitation->mutex_);
    if (invitation->view_.state == InvitationState::kJoined) invitation->view_.state = InvitationState::kOpen;
    throw;
  }
  SessionStore::Opened opened =
      sessions.open_for_guest("guest " + invitation->terms().guest, invitation, invitation->deadline());
  invitation->belongs_to(opened.session);
  return opened;
}

bool Invitations::revoke(std::string_view id) {
  const std::shared_ptr<Invitation> invitation = find(id);
  return invitation && invitation->end(InvitationEnd::kRevoked);
}

void Invitations::leave(Invitation& invitation) { end(invitation, InvitationEnd::kLeft); }

void Invitations::end(Invitation& invitation, InvitationEnd why) {
  if (invitation.end(why)) ended_(invitation, why);
}

std::list<std::shared_ptr<Invitation>> Invitations::list() const {
  const std::lock_guard guard(mutex_);
  std::list<std::shared_ptr<Invitation>> all;
  for (const Entry& entry : entries_) all.push_back(entry.invitation);
  return all;
}

std::shared_ptr<Invitation> Invitations::find(std::string_view id) const {
  const std::lock_guard guard(mutex_);
  const auto found =
      std::ranges::find_if(entries_, [&](const Entry& entry) { return entry.invitation->id() == id; });
  return found == entries_.end() ? nullptr : found->invitation;
}

void Invitations::sweep(const std::function<std::string(const std::string& room)>& running_case,
                        const std::function<bool(const InvitationTerms&)>& is_void) {
  for (const std::shared_ptr<Invitation>& each : list()) {
    if (each->view().state == InvitationState::kEnded) continue;
    std::optional<InvitationEnd> why = each->reason_to_end(running_case(each->terms().room));
    if (!why && is_void(each->terms())) why = InvitationEnd::kInviter;
    if (why) end(*each, *why);
  }
}

void Invitations::end_all(InvitationEnd why) {
  for (const std::shared_ptr<Invitation>& each : list()) end(*each, why);
}

}  // namespace kiroku::viewer
