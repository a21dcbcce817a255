#include "apps/fleet/verified_cases.h"

#include <algorithm>
#include <utility>

#include "apps/common/command_line.h"
#include "base/number_text.h"

namespace kiroku::apps {
namespace {

using archive::Verdict;

/// The finding that the verdict stands on, in its sentence.
std::string gravest(const archive::VerificationReport& report) {
  const auto worst = std::ranges::max_element(report.findings, {}, &archive::Finding::severity);
  return worst == report.findings.end() || worst->severity == archive::Severity::kNote ? "" : worst->text;
}

/// What the verdict does not say: that the appliance log beside the case, as the store has it, ends before
/// the case does.
std::string not_told_by_log(const archive::VerificationReport& report) {
  if (!report.in_log || !report.close_entry) return "";
  const archive::CaseInLog& known = *report.in_log;
  if (known.end && known.entries > *report.close_entry) return "";
  return "the appliance log knows no end of the case yet";
}

}  // namespace

fleet::Verification verification_of(const archive::VerificationReport& report) {
  const auto told =
      static_cast<std::size_t>(std::ranges::count_if(report.findings, [](const archive::Finding& each) {
        return each.severity != archive::Severity::kNote;
      }));
  const int status = archive::exit_status(report.verdict);
  std::string detail = gravest(report);
  if (const std::string more = not_told_by_log(report); !more.empty())
    detail += (detail.empty() ? "" : "; ") + more;
  return {std::string(archive::verdict_name(report.verdict)), status != kDone && status != kNoAnswer, told,
          std::move(detail)};
}

fleet::Verification verification_of(const archive::VerificationReport& report, const fleet::Mending& mending,
                                    const HoldDifference& hold) {
  fleet::Verification found = verification_of(report);
  const auto tell = [&](std::size_t count, const char* what) {
    if (count > 0)
      found.detail += (found.detail.empty() ? "" : "; ") + counted(count, "object", "objects") + what;
  };
  tell(mending.mended.size(), " mended in the store");
  tell(mending.left_count(), " could not be mended");
  tell(mending.erased.size(), " erased by the appliance and lost or damaged in the store, not put again");
  if (!hold.text.empty()) found.detail += (found.detail.empty() ? "" : "; ") + hold.text;
  if (hold.lifted) ++found.findings;
  return found;
}

void VerifiedCases::add(const fleet::Verification& entered) {
  ++done_;
  if (entered.alarm) ++not_intact_;
  if (entered.verdict == archive::verdict_name(Verdict::kIncomplete)) ++incomplete_;
  if (entered.verdict == archive::verdict_name(Verdict::kUnproven)) ++unproven_;
}

void VerifiedCases::compare(const fleet::FleetTotals& catalogue) {
  const auto beyond = [](std::uint64_t all, std::uint64_t own) { return all > own ? all - own : 0; };
  elsewhere_not_intact_ = beyond(catalogue.alarms, not_intact_);
  elsewhere_unproven_ = beyond(catalogue.incomplete + catalogue.unproven + catalogue.unchecked,
                               incomplete_ + unproven_ + unchecked_);
  missing_ = catalogue.missing;
  unreadable_ = catalogue.unverified_unreadable;
  // Of a run that was ended nobody knows whether it left out a case for its age, or had not come to it yet.
  unsettled_ = ended_early_ ? 0 : catalogue.unverified_closed;
}

int VerifiedCases::status() const {
  if (not_intact_ + elsewhere_not_intact_ + missing_ + unreadable_ > 0) return kAnswerIsNo;
  const bool is_known =
      incomplete_ + unproven_ + unchecked_ + left_ + lifted_ + elsewhere_unproven_ + unsettled_ == 0;
  return is_known && !ended_early_ ? kDone : kNoAnswer;
}

std::string VerifiedCases::summary() const {
  std::string words = counted(done_, "case", "cases") + " verified";
  const auto add = [&](std::uint64_t count, const char* what) {
    if (count > 0) words += ", " + std::to_string(count) + " " + what;
  };
  add(not_intact_, "NOT INTACT");
  add(incomplete_, "incomplete");
  add(unproven_, "unproven");
  add(unchecked_, "could not be checked");
  if (mended_ > 0) words += "; " + counted(mended_, "object", "objects") + " mended in the store";
  if (left_ > 0) words += "; " + counted(left_, "object", "objects") + " could not be mended";
  if (lifted_ > 0)
    words += "; of " + counted(lifted_, "case", "cases") + " under legal hold the store does not hold all";
  std::string beside;
  const auto add_beside = [&](std::uint64_t count, const char* what) {
    if (count > 0) beside += (beside.empty() ? "" : ", ") + std::to_string(count) + " " + what;
  };
  add_beside(elsewhere_not_intact_, "NOT INTACT that this run did not verify");
  add_beside(elsewhere_unproven_, "not proven or not checked that this run did not verify");
  if (!beside.empty()) words += "; in the catalogue " + beside;
  beside.clear();
  add_beside(missing_, "missing from the store");
  add_beside(unreadable_, "whose ledger cannot be read");
  add_beside(unsettled_, "that changed just now");
  if (!beside.empty()) words += "; not looked at: " + beside;
  return ended_early_ ? words + "; ended before every case was looked at" : words;
}

}  // namespace kiroku::apps
