#include "apps/kiroku/renewal_results.h"

#include <algorithm>
#include <iostream>

#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/common/format.h"
#include "base/json_or_null.h"
#include "base/printable.h"

namespace kiroku::apps {
namespace {

using archive::EvidenceRenewal;
using What = EvidenceRenewal::What;

std::string words_of(What what, bool dry_run) {
  switch (what) {
    case What::kBegun:
      return dry_run ? "a record would be begun" : "a record was begun";
    case What::kTimeStampRenewed:
      return dry_run ? "its newest time-stamp would be renewed" : "its newest time-stamp was renewed";
    case What::kHashTreeRenewed:
      return dry_run ? "all its data would be read again under a new hash"
                     : "all its data was read again under a new hash";
    case What::kNothingDue:
      return "nothing is due";
    case What::kStillOpen:
      return "left alone";
    case What::kWaits:
      return "waits";
    case What::kRefused:
      break;
  }
  return "nothing was renewed";
}

}  // namespace

bool is_renewed(What what) {
  return what == What::kBegun || what == What::kTimeStampRenewed || what == What::kHashTreeRenewed;
}

nlohmann::ordered_json renewal_json(const EvidenceRenewal& renewal) {
  return {{"case", renewal.case_id},
          {"what", archive::name_of(renewal.what)},
          {"reason", renewal.text},
          {"renew_before", or_null(renewal.before)},
          {"later_entries", renewal.later_entries},
          {"unread", renewal.unread}};
}

void RenewalTeller::count(const EvidenceRenewal& renewal) {
  if (renewal.what == What::kNothingDue) ++nothing_due_;
  if (renewal.what == What::kRefused) ++refused_;
  if (renewal.what == What::kWaits || (dry_run_ && is_renewed(renewal.what))) ++waiting_;
  if (renewal.before && (is_renewed(renewal.what) || renewal.what == What::kNothingDue))
    next_ = next_ ? std::min(*next_, *renewal.before) : renewal.before;
}

void RenewalTeller::tell(const EvidenceRenewal& renewal, const std::string& appliance) {
  count(renewal);
  const std::string name = (appliance.empty() ? "" : appliance + "/") + renewal.case_id;
  if (renewal.later_entries > 0) {
    std::cout << printable(name) << ": " << renewal.later_entries
              << (renewal.later_entries == 1 ? " entry" : " entries")
              << " came after what its record covers, which says nothing of them: '" << program_
              << " renew --take-in' brings them in\n";
  }
  if (renewal.what == What::kNothingDue) return;
  const std::string line = name + ": " + words_of(renewal.what, dry_run_) + ": " + renewal.text;
  if (renewal.what == What::kRefused) {
    print_error(program_, line);
  } else {
    std::cout << printable(line) << "\n";
  }
  for (const std::string& file : renewal.unread)
    std::cout << "  not as recorded: " << printable(file) << "\n";
  std::cout.flush();
}

void RenewalTeller::sum_up() const {
  if (nothing_due_ > 0) {
    std::cout << nothing_due_ << (nothing_due_ == 1 ? " record needs" : " records need") << " nothing.\n";
  }
  if (next_) std::cout << "The next end is at " << format_utc_for_people(*next_) << ".\n";
}

int RenewalTeller::status() const {
  if (refused_ > 0) return kAnswerIsNo;
  return waiting_ > 0 ? kNoAnswer : kDone;
}

}  // namespace kiroku::apps
