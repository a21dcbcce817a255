#include "apps/sim/plan_at_hand.h"

#include <utility>

#include "apps/common/file.h"
#include "apps/sim/plan_reading.h"
#include "apps/sim/sealed_files.h"
#include "base/check.h"
#include "base/error.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

fs::path plan_of_seal(const fs::path& seal_file) {
  const PlanSeal seal =
      parse_plan_seal(text_of(read_small_file(seal_file, "the sealed plan")), seal_file.string());
  const fs::path folder = seal_file.parent_path();
  for (const Check& check : check_sealed_files(seal.files, folder)) {
    if (check.answer != Check::Answer::kHolds)
      throw Error("the plan is not the one that was sealed: " + check.text + "; see kiroku plan verify " +
                  seal_file.string());
  }
  return folder / seal.files.front().name;
}

}  // namespace

std::optional<PlanAtHand> read_plan_at_hand(const fs::path& named, bool json) {
  fs::path file = named;
  if (file.string().ends_with(".seal.json")) file = plan_of_seal(file);
  auto plan = read_plan_and_tell(file.string(), json);
  if (!plan) return {};
  PlanAtHand at_hand{std::move(*plan), {}, {}, false, {}};
  at_hand.files = seal_of_plan(file, at_hand.plan.name);
  at_hand.seal = crypto::sha256(bytes_of(plan_seal_text(at_hand.files)));
  fs::path seal = file;
  std::error_code ignored;
  if (fs::exists(seal.replace_extension(".seal.json"), ignored))
    at_hand.sealed = crypto::sha256(read_small_file(seal, "the sealed plan")) == at_hand.seal;
  at_hand.seal_file = std::move(seal);
  return at_hand;
}

}  // namespace kiroku::apps
