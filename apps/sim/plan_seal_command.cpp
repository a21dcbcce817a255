// 'kiroku plan seal' and 'kiroku plan verify'.
#include <algorithm>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/plan_seal.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/sim/plan_command.h"
#include "apps/sim/plan_reading.h"
#include "apps/sim/plan_sealing.h"
#include "apps/sim/sealed_files.h"
#include "archive/reading/case_reader.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "sim/plan/plan_files.h"
#include "sim/respiration/breathing_model.h"
#include "viewer/http/disk_room.h"
#include "viewer/kept/log_of_case.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Request {
  std::string file;
  std::optional<std::string> home, case_folder;
  std::vector<std::string> authorities;
  NamedRoots roots;
  bool json = false;
};

/// The name of a plan that can be carried out; nothing once its errors are told. kiroku::Error for a
/// breathing lung that is none.
std::optional<std::string> read_name(const Request& request) {
  if (sim::kind_of_plan(request.file) == sim::PlanKind::kBreathing) {
    const sim::BreathingModel model = sim::read_breathing_model(request.file);
    if (!request.json) {
      for (const std::string& warning : model.warnings) print_error("kiroku", "warning: " + warning);
    }
    return model.name;
  }
  const auto plan = read_plan_and_tell(request.file, request.json);
  return plan ? std::optional(plan->name) : std::nullopt;
}

int seal(const Request& request) {
  require_unsealed(request.file);
  const Home home = Home::open(request.home);
  viewer::require_disk_room(home.archive(), 0, "free some, then seal the plan again");
  const auto name = read_name(request);
  if (!name) return kRefused;
  const WritableHome writable(home);
  const SealedPlan made =
      seal_plan_file(home, request.file, *name, request.authorities, writable.trust,
                     [&](const crypto::Sha256Digest& digest) { writable.log->plan_sealed(digest); });
  if (request.json) {
    print_json({{"seal", made.file.string()},
                {"sha256", crypto::to_hex(made.digest)},
                {"files", made.seal.files.size()},
                {"time", time_of(made.stamps)},
                {"time_stamps", stamps_json(made.stamps)}});
  } else {
    warn_of_missing(made.stamps);
    std::cout << printable(made.file.string()) << ": " << made.seal.files.size()
              << " files sealed, entered into the appliance log\n  seal  " << crypto::to_hex(made.digest)
              << "\n";
    std::cout << stamp_lines(made.stamps);
    std::cout << "  next  kiroku record --plan " << printable(made.file.string()) << " ...\n";
  }
  return any_valid(made.stamps) ? kDone : kNoAnswer;
}

std::vector<Check> check_order(const std::optional<Home>& home, const archive::CaseReader& recording,
                               const crypto::Sha256Digest& digest) {
  if (!home) {
    return {{"order", Check::Answer::kUnknown,
             "which came first is known to the log of the appliance that recorded the case: give its "
             "--home"}};
  }
  const archive::OpenEntry& open = recording.opening();
  return compare::check_sealed_before(compare::read_log_of_case(home->log_folder(), open, home->device()),
                                      home->device().to_string(),
                                      {open, recording.opened_at(), recording.opening_sha256()}, digest);
}

/// Whether the case says that it was recorded by this plan, and which came first.
std::vector<Check> check_case(const std::optional<Home>& home, const fs::path& folder,
                              const crypto::Sha256Digest& digest) {
  using Answer = Check::Answer;
  const archive::CaseReader reader = archive::CaseReader::open(folder);
  const archive::OpenEntry& open = reader.opening();
  if (!open.plan) return {{"case", Answer::kDiffers, open.case_id + " names no plan"}};
  if (*open.plan != digest)
    return {{"case", Answer::kDiffers, open.case_id + " was recorded by another plan"}};
  std::vector<Check> checks{{"case", Answer::kHolds, open.case_id + " was recorded by this plan"}};
  std::ranges::move(check_order(home, reader, digest), std::back_inserter(checks));
  return checks;
}

int verify(const Request& request) {
  const fs::path seal_path = request.file;
  const Bytes bytes = read_small_file(seal_path, "the sealed plan");
  const PlanSeal seal = parse_plan_seal(text_of(bytes), request.file);
  const crypto::Sha256Digest digest = crypto::sha256(bytes);
  const std::optional<Home> home = Home::find(request.home);
  std::vector<Check> checks = check_sealed_files(seal.files, seal_path.parent_path());
  std::ranges::move(check_tokens(request.roots, home, seal_path, digest), std::back_inserter(checks));
  checks.push_back(check_log(home, "seal", states_seal(digest)));
  if (request.case_folder) {
    std::ranges::move(check_case(home, find_case(home, *request.case_folder), digest),
                      std::back_inserter(checks));
  }
  const int status = tell_checks(
      request.file, seal.plan, checks,
      {{"seal", request.file}, {"plan", seal.plan}, {"sha256", crypto::to_hex(digest)}}, request.json);
  if (request.case_folder && !request.json)
    std::cout << "  Whether the case itself is whole tells kiroku verify.\n";
  return status;
}

}  // namespace

void add_plan_seal_commands(Command& plan) {
  Command& sealed = plan.add_command("seal", "freezes a plan before the operation");
  const auto seal_request = std::make_shared<Request>();
  sealed.argument("PLAN", seal_request->file, "the plan, or the breathing lung (.json)");
  sealed.option("--authority", "NAME", seal_request->authorities, "asks only this authority of kiroku.toml");
  add_home_option(sealed, seal_request->home);
  sealed.flag("--json", seal_request->json, "prints one JSON object instead");
  sealed.explain(
      "Writes PLAN.seal.json beside the plan: the hashes of the plan, its mesh or what that is made of, and "
      "its volume; of a breathing lung its mesh, labels and trace; of a .mhd or .nhdr file also of the file "
      "that holds its voxels. Their hash is entered into the appliance "
      "log and time-stamped (PLAN.seal.AUTHORITY.tsr). "
      "Nothing of the plan leaves the machine but that hash.");
  sealed.explain(
      "Each time-stamp says whose clock it tells: self-issued is one of the recorder's own authority, which "
      "proves no time to others. Where there is no other, a warning says so. Exit status: 0 sealed and "
      "time-stamped, self-issued or not, as for 'kiroku verify'; 3 sealed without a time-stamp.");
  sealed.example("kiroku plan seal liver.json", "and then: kiroku record --plan liver.seal.json ...");
  sealed.on_run([seal_request] { return seal(*seal_request); });

  Command& verified = plan.add_command("verify", "tells whether a sealed plan still holds, and came first");
  const auto verify_request = std::make_shared<Request>();
  verified.argument("SEAL", verify_request->file, "the sealed plan (.seal.json)");
  verified.option("--case", "CASE", verify_request->case_folder,
                  "also whether that case was recorded by this plan, which was sealed before it");
  add_root_options(verified, verify_request->roots);
  add_home_option(verified, verify_request->home);
  verified.flag("--json", verify_request->json, "prints one JSON object instead");
  verified.explain("Exit status: 0 all holds, 1 something differs, 3 something could not be checked.");
  verified.example("kiroku plan verify liver.seal.json --case 20260805T091502Z-3f9c21ab",
                   "was this operation planned so beforehand?");
  verified.on_run([verify_request] { return verify(*verify_request); });
}

}  // namespace kiroku::apps
