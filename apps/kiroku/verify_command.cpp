#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/light_verifying.h"
#include "apps/kiroku/verify_extras.h"
#include "apps/kiroku/witnessed_note.h"
#include "apps/verify/witness_judgement.h"
#include "archive/catalogue/catalogue.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"
#include "media/inspection/inspector.h"

namespace kiroku::apps {
namespace {

VerifyDefaults defaults_of(const std::optional<Home>& home, const std::filesystem::path& case_folder) {
  VerifyDefaults defaults;
  if (!home) return defaults;
  defaults.devices = {home->device()};
  defaults.trust = home->outside_root_files();
  defaults.own_authority = home->own_root_files();
  if (home->holds(case_folder)) {
    defaults.log = home->log_folder();
    // What else lies in its place says nothing against a case.
    auto note = home_witnessed_note(*home);
    if (note && is_of_log(*note, home->device())) defaults.witnessed_note = std::move(note);
  }
  return defaults;
}

void remember(const std::optional<Home>& home, const std::filesystem::path& case_folder,
              const archive::VerificationReport& report, const HowVerified& how) {
  if (!home || !home->holds(case_folder)) return;
  if (how.decrypted) log_access(home, case_folder, "verified with an identity");
  if (archive::is_excerpt(case_folder)) return;  // the catalogue lists cases
  if (!how.by_defaults) return;  // it tells verdicts by what this home trusts, and not by what somebody named
  try {
    const std::string case_id = std::filesystem::canonical(case_folder).filename().string();
    const auto catalogue = archive::Catalogue::open(home->catalogue_file());
    catalogue->refresh(case_folder);
    catalogue->set_verdict(case_id, std::string(archive::verdict_name(report.verdict)), utc_now());
  } catch (const Error& error) {
    print_error("kiroku", std::string("warning: the catalogue does not know this verdict: ") + error.what());
  }
}

}  // namespace

void add_verify_command(Command& program) {
  Command& command = program.add_command("verify", "tells whether a case is whole and when it existed");
  const auto asked_home = std::make_shared<std::optional<std::string>>();
  VerifyExtras extras = verify_extras(asked_home);
  extras.read_light = light_reading(asked_home);
  make_verify_command(command, extras);
  add_home_option(command, *asked_home);
}

VerifyExtras verify_extras(const std::shared_ptr<std::optional<std::string>>& asked_home) {
  const auto home = [asked_home] { return Home::find(*asked_home); };
  VerifyExtras extras;
  extras.find_case = [home](const std::string& named) { return find_case(home(), named); };
  extras.defaults = [home](const std::filesystem::path& folder) { return defaults_of(home(), folder); };
  extras.inspect = media::decoding_inspector();
  extras.verified = [home](const std::filesystem::path& folder, const archive::VerificationReport& report,
                           const HowVerified& how) { remember(home(), folder, report, how); };
  return extras;
}

}  // namespace kiroku::apps
