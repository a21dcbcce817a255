#include "archive/verify/verdict.h"

#include <algorithm>
#include <array>
#include <utility>

namespace kiroku::archive {

Verdict verdict_of(Severity worst) {
  switch (worst) {
    case Severity::kNote:
      return Verdict::kIntact;
    case Severity::kGap:
      return Verdict::kIntactWithGaps;
    case Severity::kUnproven:
      return Verdict::kUnproven;
    case Severity::kIncomplete:
      return Verdict::kIncomplete;
    case Severity::kTampered:
      break;
  }
  return Verdict::kTampered;
}

Verdict verdict_of_excerpt(Severity worst) {
  const Verdict verdict = verdict_of(worst);
  const bool intact = verdict == Verdict::kIntact || verdict == Verdict::kIntactWithGaps;
  return intact ? Verdict::kIntactExcerpt : verdict;
}

std::vector<TimeRemark> time_remarks(const VerificationReport& report) {
  constexpr auto kByCode = std::to_array<std::pair<std::string_view, TimeRemark>>(
      {{"stamped-after-close", TimeRemark::kThereByThen},
       {"first-stamped-late", TimeRemark::kFirstStampedLate},
       {"segments-entered-late", TimeRemark::kEnteredLate},
       {"end-stamped-late", TimeRemark::kEndStampedLate},
       {"clock-differs", TimeRemark::kClockDiffers},
       {"close-utc-differs", TimeRemark::kLengthDiffers}});
  std::vector<TimeRemark> remarks;
  for (const auto& [code, remark] : kByCode) {
    if (std::ranges::find(report.findings, code, &Finding::code) != report.findings.end()) {
      remarks.push_back(remark);
    }
  }
  return remarks;
}

std::uint64_t listed_segments(const VerificationReport& report) {
  // Its streams count what it holds.
  if (report.excerpt) return report.excerpt->listed_segments;
  std::uint64_t listed = 0;
  for (const StreamReport& stream : report.streams) listed += stream.segments - stream.erased_segments;
  return listed;
}

std::uint64_t named_files(const VerificationReport& report) {
  const std::uint64_t others = report.checkpoints + (report.excerpt ? kFilesOfAnExcerpt : kFilesOfACase);
  return report.files - std::min(others, report.files);
}

std::string_view signatures_name(SignaturesChecked signatures) {
  switch (signatures) {
    case SignaturesChecked::kEd25519:
      return "ed25519";
    case SignaturesChecked::kBoth:
      return "ed25519+ml-dsa-65";
    case SignaturesChecked::kHardware:
      return "ed25519+ecdsa-p256";
    case SignaturesChecked::kAll:
      return "ed25519+ml-dsa-65+ecdsa-p256";
    case SignaturesChecked::kNone:
      break;
  }
  return "none";
}

std::string_view verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kIntact:
      return "intact";
    case Verdict::kIntactWithGaps:
      return "intact-with-gaps";
    case Verdict::kIntactExcerpt:
      return "intact-excerpt";
    case Verdict::kUnproven:
      return "unproven";
    case Verdict::kIncomplete:
      return "incomplete";
    case Verdict::kTampered:
      break;
  }
  return "tampered";
}

int exit_status(Verdict verdict, bool excerpt_accepted) {
  constexpr int kYes = 0;
  constexpr int kNo = 1;
  constexpr int kNoAnswer = 3;
  constexpr int kOfAPart = 4;
  switch (verdict) {
    case Verdict::kIntact:
    case Verdict::kIntactWithGaps:
      return kYes;
    case Verdict::kIntactExcerpt:
      return excerpt_accepted ? kYes : kOfAPart;
    case Verdict::kUnproven:
    case Verdict::kIncomplete:
      return kNoAnswer;
    case Verdict::kTampered:
      break;
  }
  return kNo;
}

std::string_view time_proof_name(TimeProof proof) {
  switch (proof) {
    case TimeProof::kExternal:
      return "external";
    case TimeProof::kExternalInPart:
      return "external-in-part";
    case TimeProof::kSelfIssued:
      return "self-issued";
    case TimeProof::kNone:
      break;
  }
  return "none";
}

}  // namespace kiroku::archive
