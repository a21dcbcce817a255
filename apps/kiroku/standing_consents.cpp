#include "apps/kiroku/standing_consents.h"

#include "apps/common/file.h"
#include "apps/kiroku/kept_log.h"
#include "apps/kiroku/user_name.h"
#include "apps/kiroku/witnessed_note.h"
#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/storage/file_system.h"
#include "archive/upkeep/holds.h"
#include "archive/verify/case_data.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::apps {
namespace {

/// The case of the home's archive that this folder elsewhere is a copy of (a replica, a stick); nothing where
/// there is none.
std::optional<std::string> own_case_copied_to(const Home& home, const std::filesystem::path& case_folder) {
  const archive::CaseFolder folder = archive::CaseFolder::open(case_folder);
  const std::string case_id = archive::read_case_id(folder);
  if (!archive::is_case_id(case_id) || !std::filesystem::exists(home.archive() / case_id)) return {};
  return case_id;
}

}  // namespace

ConsentConfiguration consent_configuration(const Home& home) {
  const std::filesystem::path file = home.configuration_file();
  if (std::error_code ignored; !std::filesystem::exists(file, ignored)) return {};
  return parse_consent_configuration(text_of(read_small_file(file, "the configuration")), file.string());
}

archive::Consents standing_consents(const Home& home) {
  // What the log itself shows says more than that it is another one.
  archive::Consents consents =
      archive::read_consents(home.log_folder(), home.device(), home_witnessed_checkpoint(home));
  require_same_log(home);
  return consents;
}

void enter_use(const Home& home, const std::filesystem::path& case_folder, const std::string& purpose,
               const std::string& what) {
  if (!home.holds(case_folder)) {
    throw UsageError(case_folder.string() +
                     " is not in this home's archive: its appliance log tells of no consent to the purpose " +
                     printable(purpose) + "; ask where the case was recorded");
  }
  const ConsentConfiguration site = consent_configuration(home);
  if (!site.knows(purpose)) {
    throw UsageError("'" + printable(purpose) +
                     "' is no purpose of this site; [consent] of kiroku.toml has " + site.known());
  }
  const std::string case_id = std::filesystem::canonical(case_folder).filename().string();
  const crypto::SigningKey key = home.signing_key();
  const auto log = open_log(home, key);
  const archive::ErasingTurn turn(home.archive());
  const std::string why_not = archive::why_not_consented(standing_consents(home), case_id, purpose);
  if (!why_not.empty()) throw UsageError(why_not + ": nothing was handed out");
  log->access_for(purpose, case_id, what, user_name());
}

bool enter_purpose(const std::optional<Home>& home, const std::filesystem::path& case_folder,
                   const std::optional<std::string>& purpose, const std::string& what) {
  if (purpose && !home) {
    throw UsageError(
        "--purpose goes by the consents in a home's appliance log, and there is no home: name it with "
        "--home");
  }
  if (purpose) {
    enter_use(*home, case_folder, *purpose, what);
    return true;
  }
  if (!home) return false;
  // Most sites demand none: then nothing is read of the case.
  const ConsentConfiguration site = consent_configuration(*home);
  if (!site.demand_purpose) return false;
  if (home->holds(case_folder))
    throw UsageError(
        "this site demands a purpose of every export ([consent] of kiroku.toml): say which with "
        "--purpose, one of " +
        site.known());
  if (const std::optional<std::string> copied = own_case_copied_to(*home, case_folder))
    throw UsageError(printable(case_folder.string()) + " is a copy of this home's case " + *copied +
                     ", and this site demands a purpose of every export ([consent] of kiroku.toml): name " +
                     *copied + ", and say with --purpose what for");
  return false;
}

}  // namespace kiroku::apps
