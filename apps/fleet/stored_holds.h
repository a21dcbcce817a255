// Whether a store holds a case as its appliance's log says. Functions; one thread at a time.
#pragma once

#include <optional>
#include <string>

#include "archive/upkeep/holds.h"
#include "fleet/fetcher.h"

namespace kiroku::apps {

/// Where the store and the log differ about a case's legal hold. It is about who may remove what, and no part
/// of the verdict: that is of what is there.
struct HoldDifference {
  std::string text;         // a sentence for people, without its full stop; "" where they agree
  bool lifted = false;      // the log says that it is held, and the store tells of objects that are not
  fleet::ListedVersion of;  // one object that differs
};

/// Compares what the store told of the objects that were fetched with the holds that stand by the log.
HoldDifference compare_holds(const archive::Holds& by_log, const std::string& case_id,
                             const fleet::HoldsSeen& in_store);

}  // namespace kiroku::apps
