#include "apps/fleet/stored_holds.h"

#include "base/number_text.h"
#include "base/printable.h"

namespace kiroku::apps {

HoldDifference compare_holds(const archive::Holds& by_log, const std::string& case_id,
                             const fleet::HoldsSeen& in_store) {
  const std::string why = archive::why_held(by_log, case_id);
  const auto of_all = [&](std::uint64_t count) {
    return std::to_string(count) + " of " + counted(in_store.held + in_store.free, "object", "objects");
  };
  if (!why.empty() && in_store.free > 0) {
    if (!in_store.are_locks_told)
      return {
          "the appliance log says of the case that " + why +
              ", and the store tells this access key of no lock and no hold: it may lack the rights to look "
              "at them",
          false, in_store.first_free};
    return {"the store does not hold " + of_all(in_store.free) + ", as " +
                printable(in_store.first_free.key) + ", and the appliance log says of the case that " + why +
                ": somebody lifted it in the store, or 'kiroku ship' could not set it" +
                (in_store.held == 0 ? ", or this access key may not look at holds" : ""),
            true, in_store.first_free};
  }
  if (why.empty() && in_store.held > 0)
    return {"the store has " + of_all(in_store.held) + " under legal hold, as " +
                printable(in_store.first_held.key) + ", and the appliance log knows no hold of the case",
            false, in_store.first_held};
  return {};
}

}  // namespace kiroku::apps
