#include "viewer/api/viewer_context.h"

#include <algorithm>

#include "archive/storage/file_system.h"
#include "archive/upkeep/holds.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::viewer {
namespace {

const char* reason_of(InvitationEnd why) {
  switch (why) {
    case InvitationEnd::kRevoked:
      return "it was revoked";
    case InvitationEnd::kTime:
      return "its time is over";
    case InvitationEnd::kCase:
      return "the case is over";
    case InvitationEnd::kLeft:
      return "the guest left";
    case InvitationEnd::kInviter:
      return "the inviter was removed or changed";
    case InvitationEnd::kStopped:
      return "the viewer was stopped";
  }
  return "";
}

}  // namespace

ViewerContext::ViewerContext(ViewerHome home, SessionLimits session_limits, Tell tell)
    : home_(std::move(home)),
      tell_(std::move(tell)),
      sessions_(session_limits, *home_.clock),
      invitations_(
          [this](const Invitation& invitation, InvitationEnd why) {
            const InvitationTerms& terms = invitation.terms();
            note_access(case_of(terms.room),
                        "invitation " + invitation.id() + " of guest " + terms.guest + " to " + terms.room +
                            " ended: " + reason_of(why),
                        "kiroku view");
          },
          *home_.clock),
      users_(UserStore::open(home_.users_file, home_.password_hasher)),
      devices_(KnownDevices::open(home_.users_file.parent_path() / "devices.sqlite")),
      own_log_(home_.log == nullptr
                   ? archive::ApplianceLog::open(archive::real_file_system(), home_.log_folder,
                                                 *home_.device_key, home_.device.name())
                   : nullptr),
      log_(own_log_ ? own_log_.get() : home_.log) {
  if (!own_log_) return;
  if (const std::string damage = log_->damage(); !damage.empty()) tell(damage);
  for (const std::string& remark : log_->remarks()) tell(remark);
  log_->tell_of_remarks([tell](const std::string& remark) { tell(remark); });
}

playback::CasePlace ViewerContext::case_place(const Request& request) const {
  const std::string& id = request.parameter("case");
  if (home_.stored) {
    std::optional<StoredCases::Found> found = home_.stored->find(id);
    if (!found) throw Refusal(404, "the store has no case " + id);
    return std::move(found->place);
  }
  std::filesystem::path folder = home_.archive / id;
  std::error_code failed;
  if (!std::filesystem::is_directory(std::filesystem::symlink_status(folder, failed)) ||
      archive::is_excerpt(folder)) {
    throw Refusal(404, "there is no case " + id);
  }
  return folder;
}

archive::CaseReader ViewerContext::open_case(const Request& request) const {
  return case_place(request).read();
}

Session::Identities ViewerContext::require_unlocked(const Request& request) {
  Session::Identities identities = request.session->identities();
  if (identities == nullptr) throw Refusal(423, "recordings are locked: unlock them with an identity first");
  return identities;
}

void ViewerContext::require_pace(const std::string& person) {
  const auto wait = pace_.take(person, home_.clock->now());
  if (wait.count() == 0) return;
  throw Refusal(429,
                "more was done than the appliance log takes of one person at a time: try again in " +
                    std::to_string(wait.count()) + " s",
                wait);
}

void ViewerContext::enter_access(const Request& request, const std::string& case_id,
                                 const std::string& what) {
  require_pace(request.session->person());
  enter(case_id, what, request.session->user(), request.peer);
}

void ViewerContext::enter_access(const std::string& case_id, const std::string& what, const std::string& who,
                                 const std::string& peer) {
  require_pace(person_of(who));
  enter(case_id, what, who, peer);
}

SitePurposes ViewerContext::site_purposes() const {
  if (!home_.consent.purposes) return {};
  try {
    return home_.consent.purposes();
  } catch (const Error& error) {
    throw Refusal(
        500, std::string("the site's purposes cannot be read, so nothing is handed out: ") + error.what());
  }
}

void ViewerContext::enter_use(const Request& request, const std::string& case_id, const std::string& purpose,
                              const std::string& what) {
  const SitePurposes site = site_purposes();
  if (std::ranges::find(site.names, purpose) == site.names.end()) {
    throw Refusal(400, "'" + printable(purpose) + "' is no purpose of this site: nothing was handed out");
  }
  require_pace(request.session->person());
  // From the look at the consents to the entry: 'kiroku consent withdraw' waits for this turn.
  const archive::ErasingTurn turn(home_.archive);
  std::string why_not;
  try {
    const archive::Consents consents =
        home_.consent.consents ? home_.consent.consents() : archive::Consents();
    why_not = archive::why_not_consented(consents, case_id, purpose);
  } catch (const Error& error) {
    throw Refusal(422, std::string("could not check the consent, so nothing is handed out: ") + error.what());
  }
  if (!why_not.empty()) throw Refusal(403, why_not + ": nothing was handed out");
  enter(case_id, what, request.session->user(), request.peer, purpose);
}

void ViewerContext::enter(const std::string& case_id, const std::string& what, const std::string& who,
                          const std::string& peer, const std::optional<std::string>& purpose) {
  const std::string from = who + " (kiroku view, " + peer + ")";
  try {
    if (purpose) {
      log_->access_for(*purpose, case_id, what, from);
    } else {
      log_->access(case_id, what, from);
    }
  } catch (const Error& error) {
    tell_(std::string("the appliance log cannot be written, so nothing is shown: ") + error.what());
    throw Refusal(500, "the appliance log cannot be written, so nothing is shown");
  }
}

void ViewerContext::note_access(const std::string& case_id, const std::string& what, const std::string& who) {
  try {
    log_->access(case_id, what, who);
  } catch (const Error& error) {
    tell_("the appliance log cannot be written, and lacks that " + who + " " + what + ": " + error.what());
  }
}

std::string ViewerContext::running_case(const std::string& room) const {
  return home_.rooms.running_case ? home_.rooms.running_case(room) : std::string();
}

std::string ViewerContext::case_of(const std::string& room) const {
  std::string running = running_case(room);
  return running.empty() ? kEveryCase : running;
}

void ViewerContext::enter_access_once(const Request& request, const std::string& case_id,
                                      const std::string& what) {
  request.session->once(case_id + " " + what, [&] { enter_access(request, case_id, what); });
}

}  // namespace kiroku::viewer
