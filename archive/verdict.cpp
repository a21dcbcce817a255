#include "archive/verdict.h"

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

std::string_view verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kIntact:
      return "intact";
    case Verdict::kIntactWithGaps:
      return "intact-with-gaps";
    case Verdict::kUnproven:
      return "unproven";
    case Verdict::kIncomplete:
      return "incomplete";
    case Verdict::kTampered:
      break;
  }
  return "tampered";
}

int exit_status(Verdict verdict) {
  constexpr int kYes = 0;
  constexpr int kNo = 1;
  constexpr int kNoAnswer = 3;
  switch (verdict) {
    case Verdict::kIntact:
    case Verdict::kIntactWithGaps:
      return kYes;
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
