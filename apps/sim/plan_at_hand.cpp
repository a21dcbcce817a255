#include "apps/sim/plan_at_hand.h"

#include <utility>

#include "apps/common/file.h"
#include "apps/sim/plan_reading.h"
#include "apps/sim/sealed_files.h"
#include "base/check.h"
#include "base/error.h"
#include "sim/plan/plan_files.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

bool is_seal(const fs::path& named) { return named.string().ends_with(".seal.json"); }

PlanSeal seal_in(const fs::path& seal_file) {
  return parse_plan_seal(text_of(read_small_file(seal_file, "the sealed plan")), seal_file.string());
}

fs::path plan_of_seal(const fs::path& seal_file) {
  const PlanSeal seal = seal_in(seal_file);
  const fs::path folder = seal_file.parent_path();
  for (const Check& check : check_sealed_files(seal.files, folder)) {
    if (check.answer != Check::Answer::kHolds)
      throw Error("the plan is not the one that was sealed: " + check.text + "; see kiroku plan verify " +
                  seal_file.string());
  }
  return folder / seal.files.front().name;
}

}  // namespace

fs::path plan_file_of(const fs::path& named) { return is_seal(named) ? plan_of_seal(named) : named; }

bool is_breathing(const fs::path& named) {
  const fs::path file = is_seal(named) ? named.parent_path() / seal_in(named).files.front().name : named;
  return sim::kind_of_plan(file) == sim::PlanKind::kBreathing;
}

FilesAtHand files_at_hand(const fs::path& plan, const std::string& name) {
  FilesAtHand at_hand;
  at_hand.files = seal_of_plan(plan, name);
  at_hand.seal = crypto::sha256(bytes_of(plan_seal_text(at_hand.files)));
  fs::path seal = plan;
  std::error_code ignored;
  if (fs::exists(seal.replace_extension(".seal.json"), ignored))
    at_hand.sealed = crypto::sha256(read_small_file(seal, "the sealed plan")) == at_hand.seal;
  at_hand.seal_file = std::move(seal);
  return at_hand;
}

std::optional<PlanAtHand> read_plan_at_hand(const fs::path& named, bool json) {
  const fs::path file = plan_file_of(named);
  auto plan = read_plan_and_tell(file.string(), json);
  if (!plan) return {};
  FilesAtHand files = files_at_hand(file, plan->name);
  return PlanAtHand{std::move(files), std::move(*plan)};
}

}  // namespace kiroku::apps
