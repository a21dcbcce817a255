// The documents about a verification: the report that a court reads, the receipt that somebody keeps, the
// certificate that somebody signs (docs/reference/report.md). Pure functions of their input, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "archive/verify/report.h"
#include "viewer/report/case_facts.h"
#include "viewer/report/checks.h"
#include "viewer/report/document.h"
#include "viewer/report/stated_consents.h"

namespace kiroku::report {

struct ReportInput {
  archive::VerificationReport verification;
  CaseFacts facts;
  Given given;          // what the verification was made with
  std::string author;   // who ordered the document
  std::string program;  // "kiroku 0.1.0"
  UtcTime made;
  Language language = Language::kEnglish;
  std::vector<Attachment> attachments = {};     // that the document carries along (proof_files.h)
  std::optional<StatedConsents> consents = {};  // of the log that was given; nothing: none was
};

/// Verdict in words, what was checked and what not, the chain, streams, gaps, times, every finding, keys,
/// hashes, and how to check again.
Document make_report(const ReportInput& input);

/// One page: case, verdict, final root, size, device key, and a QR code of the last checkpoint's exact bytes.
/// Throws kiroku::UsageError where the case has no checkpoint, or is an excerpt.
Document make_receipt(const ReportInput& input);

/// The form of a certificate by which a record authenticates itself in courts of the United States: Federal
/// Rules of Evidence 902(13) and (14), declared as 28 U.S.C. § 1746 has it. What the verification found is
/// filled in; what a person must state is left blank. English. Throws kiroku::UsageError for another
/// language, and for a record that is neither intact, intact with gaps, nor an intact excerpt.
Document make_certificate(const ReportInput& input);

}  // namespace kiroku::report
