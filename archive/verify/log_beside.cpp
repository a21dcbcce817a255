#include "archive/verify/log_beside.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "archive/format/case_folder.h"
#include "archive/verify/outside_notes.h"

namespace kiroku::archive {

namespace {

// Whoever takes such a checkpoint away leaves no finding: it vouches for nothing, and no line is hidden by
// it.
constexpr auto kHidesNoLine = std::to_array<std::string_view>(
    {"file-unnamed", "name-clash", "checkpoint-malformed", "checkpoint-unknown-key",
     "checkpoint-signature-invalid", "checkpoint-ml-dsa-missing", "checkpoint-of-other-origin",
     "checkpoint-size-differs"});

/// What tampers with the log itself, as it weighs for a case beside it. A broken line may be one about the
/// case, so that it is not known what the log says.
std::optional<CodeName> weight_beside_a_case(const FindingCode& code) {
  if (code.severity != Severity::kTampered) return std::nullopt;
  return std::ranges::find(kHidesNoLine, code.name) != kHidesNoLine.end() ? CodeName("log-not-tidy")
                                                                          : CodeName("log-not-sound");
}

}  // namespace

LogBeside read_log_beside(const VerifyOptions& options, const std::optional<OpenEntry>& of_case,
                          FindingList& findings) {
  if (!options.log) {
    return {};
  }
  const CaseFolder folder = CaseFolder::open(*options.log);
  const VerifyOptions options_of_log = with_notes_of_logs(options, true);
  FindingList of_log;
  FindingList of_cases;
  OutsideNotes outside(options_of_log, of_log);
  LogWalk walk(folder, options, of_log, of_case, &of_cases);
  walk.compare_with(outside);
  LogContents contents = walk.run();
  FindingList weighed;
  weighed.take_from(of_log, "log", weight_beside_a_case);
  contents.sound = !weighed.has("log-not-sound");
  findings.take_from(weighed, {});
  findings.take_from(of_cases, "log");
  if (contents.gave_up) {
    return {};
  }
  LogBeside beside;
  beside.walked = walked_log(contents, outside, of_case);
  beside.contents = std::move(contents);
  return beside;
}

}  // namespace kiroku::archive
