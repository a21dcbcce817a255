// What the handlers of the API share: where things lie, who has signed in, and the appliance log. All members
// are thread-safe; lives as long as the server.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "archive/reading/case_reader.h"
#include "archive/writing/appliance_log.h"
#include "base/attempt_guard.h"
#include "crypto/signed_note.h"
#include "timestamp/token_verifier.h"
#include "viewer/api/fleet_rooms.h"
#include "viewer/api/site_consent.h"
#include "viewer/api/stored_cases.h"
#include "viewer/http/request.h"
#include "viewer/people/deed_pace.h"
#include "viewer/people/invitations.h"
#include "viewer/people/known_devices.h"
#include "viewer/people/session.h"
#include "viewer/people/user_store.h"
#include "viewer/rooms/live_pictures.h"
#include "viewer/rooms/live_rooms.h"
#include "viewer/rooms/live_vitals.h"

namespace kiroku::viewer {

/// Where everything lies that is shown, and by what it is judged. What is pointed to outlives the viewer.
struct ViewerHome {
  std::filesystem::path archive, catalogue_file, log_folder, users_file, control_socket;
  /// For viewing copies, encrypted, at most `most_copy_bytes` of them; emptied at start and end.
  std::filesystem::path copies_folder;
  std::uint64_t most_copy_bytes = std::uint64_t{4} << 30;
  /// Where files lie while they are made for a download; emptied at the beginning.
  std::filesystem::path handout_folder = {};
  /// Plans beside recordings (viewer/kept/kept_comparison.h).
  std::filesystem::path comparisons_folder = {};
  /// For making more of them: the home, sealed plans below it, and kiroku-full; without that none is made.
  std::filesystem::path folder = {}, plans_folder = {}, comparison_program = {};
  /// Where programs that plan, show a breathing lung and train answer (viewer/server/inner_door.h).
  std::filesystem::path planning_socket = {}, breathing_socket = {}, training_socket = {};
  const crypto::SigningKey* device_key = nullptr;  // signs the appliance log
  /// The one that this process writes, and whose remarks it tells; null: the viewer opens one, which knows
  /// nothing of what other processes sign (archive::LogMemory).
  archive::ApplianceLog* log = nullptr;
  crypto::VerifierKey device;
  const timestamp::TrustStore* trust = nullptr;
  /// What opens recordings for whoever may watch, from signing in on; null: everybody brings their own.
  Session::Identities identities;
  LivePictures live = {};
  LiveRooms rooms = {};
  LiveVitals vitals = {};
  /// What is served of it, as the page is told: "cases", "fleet", which is `stored`, or "training",
  /// "planning" or "breathing", which leave signing in, users and the log of the API.
  std::string serves = "cases";
  /// Empty: scrypt.
  PasswordHasher password_hasher = {};
  /// Cases of many appliances, which lie in a store instead of `archive`; null: none.
  std::shared_ptr<StoredCases> stored = nullptr;
  /// Rooms of many appliances; never null beside `stored`.
  std::shared_ptr<FleetRooms> fleet_rooms = nullptr;
  /// For what cases may be used.
  SiteConsent consent = {};
  /// By which sessions and invitations end and are swept, and whoever failed to sign in waits.
  const Clock* clock = &Clock::system();
};

class ViewerContext {
 public:
  using Tell = std::function<void(const std::string& sentence)>;
  /// Opens the users and the appliance log; throws kiroku::Error where they cannot be.
  ViewerContext(ViewerHome home, SessionLimits session_limits, Tell tell);

  [[nodiscard]] const ViewerHome& home() const { return home_; }
  [[nodiscard]] SessionStore& sessions() { return sessions_; }
  [[nodiscard]] UserStore& users() { return *users_; }
  /// Locked by whoever changes the list of users for a person.
  [[nodiscard]] std::mutex& user_deeds() { return user_deeds_; }
  /// From where each user signed in before; devices.sqlite beside the list of users.
  [[nodiscard]] KnownDevices& devices() { return *devices_; }
  /// Failures of strangers; keys begin as json_fields.h has it.
  [[nodiscard]] AttemptGuard& attempts() { return attempts_; }
  [[nodiscard]] Invitations& invitations() { return invitations_; }
  /// Set once the server ends: whoever waits long for something looks at it.
  [[nodiscard]] const std::atomic<bool>& closing() const { return closing_; }
  void close() { closing_ = true; }
  /// A sentence for the server's own log.
  void tell(const std::string& sentence) const { tell_(sentence); }

  /// Where the request's {case:case} lies; Refusal 404 where the archive, or the store, has none.
  [[nodiscard]] playback::CasePlace case_place(const Request& request) const;
  [[nodiscard]] std::filesystem::path case_folder(const Request& request) const {
    return case_place(request).folder;
  }
  [[nodiscard]] archive::CaseReader open_case(const Request& request) const;
  /// What opens recordings for this session; Refusal 423 where it is locked.
  [[nodiscard]] static Session::Identities require_unlocked(const Request& request);

  /// Refusal 429 where `person` (Session::person()) does more than the appliance log is to take of one person
  /// (viewer/people/deed_pace.h); else one more counts. What enters asks by itself; for what must not be done
  /// without an entry, and is done before it.
  void require_pace(const std::string& person);
  /// An `access` entry of the appliance log: "watched endoscope". Durable when this returns; a Refusal (500)
  /// if that cannot be, so that nothing leaves unseen, and as require_pace(). Call it before the first byte
  /// does.
  void enter_access(const Request& request, const std::string& case_id, const std::string& what);
  /// The same for a purpose of the site's: a consent of this home's case to it stands, and no withdrawal is
  /// entered in between. Refusal 400 for a purpose that is none of the site's, 403 where no consent stands,
  /// 422 where nobody can tell, 500 where the site's purposes cannot be read. Waits while something of the
  /// archive is being erased.
  void enter_use(const Request& request, const std::string& case_id, const std::string& purpose,
                 const std::string& what);
  /// What the site has now; Refusal 500 where that cannot be read.
  [[nodiscard]] SitePurposes site_purposes() const;
  /// The same of somebody who has no session yet.
  void enter_access(const std::string& case_id, const std::string& what, const std::string& who,
                    const std::string& peer);
  /// The same, once a session for the same case and deed: watching asks for many pieces.
  void enter_access_once(const Request& request, const std::string& case_id, const std::string& what);
  /// The same of what happens without a request; if it cannot be entered, the server's own log says so.
  void note_access(const std::string& case_id, const std::string& what, const std::string& who);
  /// The case that is recorded in this room now, "" where none is.
  [[nodiscard]] std::string running_case(const std::string& room) const;
  /// The same as the `case` of an entry.
  [[nodiscard]] std::string case_of(const std::string& room) const;
  /// The `case` of what concerns all cases: unlocking.
  static constexpr const char* kEveryCase = "*";

 private:
  void enter(const std::string& case_id, const std::string& what, const std::string& who,
             const std::string& peer, const std::optional<std::string>& purpose = {});

  ViewerHome home_;
  Tell tell_;
  std::atomic<bool> closing_{false};
  SessionStore sessions_;
  std::mutex user_deeds_;
  AttemptGuard attempts_;
  Invitations invitations_;
  std::unique_ptr<UserStore> users_;
  std::unique_ptr<KnownDevices> devices_;
  std::unique_ptr<archive::ApplianceLog> own_log_;  // null where the home has one
  archive::ApplianceLog* log_;
  DeedPace pace_;
};

}  // namespace kiroku::viewer
