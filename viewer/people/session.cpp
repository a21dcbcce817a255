#include "viewer/people/session.h"

#include <algorithm>

#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "viewer/people/invitations.h"
#include "viewer/people/subject_shelf.h"

namespace kiroku::viewer {
namespace {

constexpr std::size_t kTokenBytes = 32;

std::string key_of(std::string_view token) { return crypto::to_hex(crypto::sha256(bytes_of(token))); }

}  // namespace

std::string random_token() {
  const crypto::Secret bytes = crypto::Secret::random(kTokenBytes);
  std::string text = crypto::to_base64(bytes.bytes(), crypto::Base64Padding::kUnpadded);
  std::ranges::replace(text, '+', '-');
  std::ranges::replace(text, '/', '_');
  return text;
}

std::string person_of(const std::string& user) { return "user " + user; }

Session::Session(std::string user, Role role, std::optional<UtcTime> credential, Clock::Time ends_at_latest,
                 std::shared_ptr<Invitation> invitation, bool must_change_password, const Clock& clock)
    : user_(std::move(user)),
      role_(role),
      credential_(credential),
      ends_at_latest_(ends_at_latest),
      invitation_(std::move(invitation)),
      must_change_password_(must_change_password),
      clock_(clock),
      last_activity_(clock.now().time_since_epoch().count()) {}

std::string Session::person() const {
  return invitation_ ? "invitation " + invitation_->id() : person_of(user_);
}

Session::Identities Session::identities() const {
  const std::lock_guard guard(mutex_);
  return identities_;
}

std::shared_ptr<SubjectShelf> Session::subjects() const {
  const std::lock_guard guard(mutex_);
  return subjects_;
}

void Session::unlock(Identities identities) {
  const std::lock_guard guard(mutex_);
  if (ended_) return;
  subjects_ = identities ? std::make_shared<SubjectShelf>(identities) : nullptr;
  identities_ = std::move(identities);
}

void Session::lock() {
  const std::lock_guard guard(mutex_);
  identities_.reset();
  subjects_.reset();
}

void Session::once(const std::string& deed, const std::function<void()>& action) {
  const std::lock_guard guard(deeds_mutex_);
  if (deeds_.contains(deed)) return;
  action();
  deeds_.insert(deed);
}

void Session::end() {
  const std::lock_guard guard(mutex_);
  ended_ = true;
  identities_.reset();
  subjects_.reset();
}

SessionStore::SessionStore(SessionLimits limits, const Clock& clock) : limits_(limits), clock_(clock) {}

bool SessionStore::has_expired(const Session& session, Clock::Time now) const {
  const Clock::Time active{Clock::Duration(session.last_activity_.load())};
  const bool is_idle = session.invitation() == nullptr && now - active >= limits_.idle;
  return session.has_ended() || now >= session.ends_at_latest_ || is_idle;
}

SessionStore::Opened SessionStore::open(const std::string& user, Role role, std::optional<UtcTime> credential,
                                        bool must_change_password) {
  return add(std::make_shared<Session>(user, role, credential, clock_.now() + limits_.longest, nullptr,
                                       must_change_password, clock_));
}

SessionStore::Opened SessionStore::open_for_guest(const std::string& name,
                                                  std::shared_ptr<Invitation> invitation,
                                                  Clock::Time ends_at) {
  return add(std::make_shared<Session>(name, Role::kGuest, std::nullopt, ends_at, std::move(invitation),
                                       false, clock_));
}

SessionStore::Opened SessionStore::add(std::shared_ptr<Session> session) {
  Opened opened{random_token(), std::move(session)};
  const std::string person = opened.session->person();
  const std::lock_guard guard(mutex_);
  std::vector<decltype(sessions_)::iterator> of_person;
  for (auto each = sessions_.begin(); each != sessions_.end(); ++each) {
    if (each->second->person() == person) of_person.push_back(each);
  }
  if (of_person.size() >= limits_.most_of_person) {
    const auto idlest = *std::ranges::min_element(
        of_person, {}, [](const auto& each) { return each->second->last_activity_.load(); });
    idlest->second->end();
    sessions_.erase(idlest);
  }
  sessions_.emplace(key_of(opened.token), opened.session);
  return opened;
}

std::shared_ptr<Session> SessionStore::find(std::string_view token, bool is_activity) {
  const std::string key = key_of(token);
  const Clock::Time now = clock_.now();
  const std::lock_guard guard(mutex_);
  const auto found = sessions_.find(key);
  if (found == sessions_.end()) return nullptr;
  if (has_expired(*found->second, now)) {
    found->second->end();
    sessions_.erase(found);
    return nullptr;
  }
  if (is_activity) note_activity(*found->second);
  return found->second;
}

void SessionStore::note_activity(Session& session) {
  session.last_activity_ = session.clock_.now().time_since_epoch().count();
}

std::chrono::seconds SessionStore::left(const Session& session) const {
  const Clock::Time active{Clock::Duration(session.last_activity_.load())};
  const auto end = session.invitation() ? session.ends_at_latest_
                                        : std::min(session.ends_at_latest_, active + limits_.idle);
  return std::max(std::chrono::floor<std::chrono::seconds>(end - clock_.now()), std::chrono::seconds(0));
}

void SessionStore::close(std::string_view token) {
  const std::lock_guard guard(mutex_);
  const auto found = sessions_.find(key_of(token));
  if (found == sessions_.end()) return;
  found->second->end();
  sessions_.erase(found);
}

void SessionStore::close_all_of(const std::string& user) {
  const std::lock_guard guard(mutex_);
  std::erase_if(sessions_, [&](const auto& each) {
    if (each.second->user() != user) return false;
    each.second->end();
    return true;
  });
}

void SessionStore::sweep(const std::function<bool(const Session&)>& is_void) {
  const Clock::Time now = clock_.now();
  const std::lock_guard guard(mutex_);
  std::erase_if(sessions_, [&](const auto& each) {
    if (!has_expired(*each.second, now) && !is_void(*each.second)) return false;
    each.second->end();
    return true;
  });
}

}  // namespace kiroku::viewer
