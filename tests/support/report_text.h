// A verification report as lines of text, for exact expectations. Functions; thread-safe.
#pragma once

#include <string>
#include <vector>

#include "archive/verify/verifier.h"

namespace kiroku::test {

/// The verdict, then one line "code file entry" for each finding, "-" for what it does not have.
inline std::string summary(const archive::VerificationReport& report) {
  std::string text(archive::verdict_name(report.verdict));
  for (const archive::Finding& finding : report.findings) {
    text += "\n" + finding.code + " " + (finding.file.empty() ? "-" : finding.file) + " " +
            (finding.entry ? std::to_string(*finding.entry) : "-");
  }
  return text;
}

/// The same of a log that lies in no archive, without the note that says so.
inline std::string summary_alone(archive::VerificationReport report) {
  std::erase_if(report.findings,
                [](const archive::Finding& each) { return each.code == "cases-not-looked-for"; });
  return summary(report);
}

/// All that a failing test should show.
inline std::string details(const archive::VerificationReport& report) {
  std::string text;
  for (const archive::Finding& finding : report.findings) {
    text += "\n  " + finding.code + " " + finding.file + " entry " +
            (finding.entry ? std::to_string(*finding.entry) : "-") + " offset " +
            (finding.offset ? std::to_string(*finding.offset) : "-") + ": " + finding.text;
  }
  return text;
}

}  // namespace kiroku::test
