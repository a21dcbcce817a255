#include "apps/sim/comparison_check.h"

#include <algorithm>
#include <filesystem>
#include <iostream>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/plan_seal.h"
#include "apps/kiroku/stamped_file.h"
#include "apps/sim/sealed_files.h"
#include "archive/reading/case_reader.h"
#include "base/error.h"
#include "base/json_or_null.h"
#include "crypto/encoding.h"
#include "viewer/kept/kept_comparison.h"
#include "viewer/kept/log_of_case.h"
#include "viewer/kept/provenance.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

/// Whether the case still begins as it did when it was compared, and was recorded by the plan that was
/// compared: a comparison with another patient's plan is as it was made, too. `names_plan`: becomes what the
/// case itself says, where it is here.
std::vector<Check> check_case(const ComparisonRequest& request, const std::optional<Home>& home,
                              const compare::Provenance& made, bool& names_plan) {
  using Answer = Check::Answer;
  const compare::CaseState& stated = made.case_state;
  fs::path folder;
  try {
    folder = find_case(home, request.named.value_or(stated.case_id));
  } catch (const Error&) {
    return {{"case", Answer::kUnknown, "the case " + stated.case_id + " is not here: name its folder"}};
  }
  try {
    const archive::OpenEntry open = archive::CaseReader::open(folder).opening();
    if (open.case_id != stated.case_id)
      return {
          {"case", Answer::kDiffers, folder.filename().string() + " is another case than " + stated.case_id}};
    const auto root = compare::root_of_first(folder, stated.ledger_size);
    if (!root) return {{"case", Answer::kDiffers, "its ledger has lost entries since"}};
    if (*root != stated.ledger_root) return {{"case", Answer::kDiffers, "its ledger was changed since"}};
    std::vector<Check> checks{{"case", Answer::kHolds,
                               "the first " + std::to_string(stated.ledger_size) + " ledger entries of " +
                                   stated.case_id + " are as they were compared"}};
    names_plan = open.plan.has_value();
    if (open.plan && *open.plan == made.plan_seal)
      checks.push_back({"case", Answer::kHolds, stated.case_id + " was recorded by this plan"});
    else if (open.plan)
      checks.push_back({"case", Answer::kDiffers, stated.case_id + " was recorded by another plan"});
    else if (made.case_names_plan)
      checks.push_back({"case", Answer::kDiffers,
                        stated.case_id + " names no plan, and the comparison says that it names one"});
    if (open.plan && !made.case_names_plan)
      checks.push_back({"case", Answer::kDiffers,
                        stated.case_id + " names a plan, and the comparison says that it names none"});
    if (open.plan && *open.plan == made.plan_seal && made.case_names_plan == false)
      checks.push_back({"case", Answer::kDiffers,
                        "the comparison says that " + stated.case_id + " was recorded by another plan"});
    return checks;
  } catch (const Error& error) {
    return {{"case", Answer::kUnknown, error.what()}};
  }
}

/// By what the case says where it is here, else by what the document states.
std::string about_the_plan(bool names_plan) {
  if (!names_plan)
    return "  The case names no plan: nothing shows that the operation was to follow this one.\n";
  return "  Whether the plan was sealed before the case tells kiroku plan verify --case.\n";
}

std::vector<Check> check_plan(const ComparisonRequest& request, const compare::Provenance& made) {
  using Answer = Check::Answer;
  if (!request.plan)
    return {{"plan", Answer::kUnknown, "name the plan, whose files are kept by whoever planned"}};
  std::vector<SealedFile> files;
  for (const compare::NamedFile& file : made.plan_files)
    files.push_back({file.role, file.name, file.bytes, file.sha256});
  std::vector<Check> checks = check_sealed_files(files, fs::path(*request.plan).parent_path(),
                                                 made.plan_sealed ? "sealed" : "compared");
  for (Check& check : checks) check.what = "plan";
  if (crypto::sha256(bytes_of(plan_seal_text({made.plan, files}))) != made.plan_seal)
    checks.push_back(
        {"plan", Answer::kDiffers, "the document's list of files does not have the seal it states"});
  return checks;
}

std::vector<Check> check_outputs(const compare::Provenance& made, const fs::path& folder) {
  using Answer = Check::Answer;
  std::vector<Check> checks;
  KnownHashes hashes;
  for (const compare::NamedFile& output : made.outputs) {
    // Only beside the document: a name that leads elsewhere is none of ours.
    const fs::path name = fs::path(output.name).filename();
    try {
      const bool same = hashes.is({output.role, output.name, output.bytes, output.sha256}, folder / name);
      checks.push_back({output.role, same ? Answer::kHolds : Answer::kDiffers,
                        name.string() + (same ? " is as it was made" : " was changed since")});
    } catch (const Error& error) {
      checks.push_back({output.role, Answer::kUnknown, error.what()});
    }
  }
  return checks;
}

}  // namespace

int verify_comparison(const ComparisonRequest& request) {
  const fs::path file = *request.verified;
  const Bytes bytes = read_small_file(file, "the comparison", compare::kLargestDocument);
  const compare::Provenance made = compare::read_provenance(text_of(bytes), file.string());
  const crypto::Sha256Digest digest = crypto::sha256(bytes);
  const std::optional<Home> home = Home::find(request.home);
  bool names_plan = made.case_names_plan.has_value();
  std::vector<Check> checks = check_case(request, home, made, names_plan);
  std::ranges::move(check_plan(request, made), std::back_inserter(checks));
  std::ranges::move(check_outputs(made, file.parent_path()), std::back_inserter(checks));
  if (made.of_one_patient == false)
    checks.push_back({"patient", Check::Answer::kDiffers,
                      "the CT stated another patient's number than the case when they were compared"});
  std::ranges::move(check_tokens(request.roots, home, file, digest), std::back_inserter(checks));
  checks.push_back(check_log(home, "comparison", [&](const archive::LogEntryBody& body) {
    const auto* const entry = std::get_if<archive::AccessEntry>(&body);
    return entry != nullptr && entry->what == compare::comparison_deed(digest) &&
           entry->case_id == made.case_state.case_id;
  }));
  const int status = tell_checks(
      file.string(), "made by " + made.made_by, checks,
      {{"comparison", file.string()},
       {"case", made.case_state.case_id},
       {"plan", made.plan},
       {"case_names_plan", or_null(made.case_names_plan)},
       {"ct_of_plan", made.ct ? nlohmann::ordered_json(made.ct->of_plan) : nlohmann::ordered_json(nullptr)},
       {"made_by", made.made_by},
       {"made_at", format_utc(made.made_at)},
       {"sha256", crypto::to_hex(digest)}},
      request.json);
  if (!request.json && made.ct && !made.ct->of_plan)
    std::cout << "  The CT that was shown is not part of the plan: nothing shows that it was planned on.\n";
  if (!request.json)
    std::cout << about_the_plan(names_plan) << "  Whether the case itself is whole tells kiroku verify.\n";
  return status;
}

}  // namespace kiroku::apps
