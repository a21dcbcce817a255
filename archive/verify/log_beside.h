// The appliance log that is given with a case or an excerpt. What it says of that case may accuse it; what is
// wrong with the log itself, or with other entries of it, does not: whoever asks for the log's own verdict
// verifies the log. Functions; thread-safe.
#pragma once

#include <optional>

#include "archive/format/ledger_entry.h"
#include "archive/verify/case_witnesses.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/log_rules.h"
#include "archive/verify/verify_options.h"

namespace kiroku::archive {

struct LogBeside {
  std::optional<LogContents>
      contents;  // nothing without a log, or where so much of it is none that it was left
  std::optional<WalkedLog> walked;
};

/// Walks options.log, if there is one, for the case that begins so. `findings` takes what is found, with
/// files below "log/". Throws kiroku::Error if the folder is no log.
LogBeside read_log_beside(const VerifyOptions& options, const std::optional<OpenEntry>& of_case,
                          FindingList& findings);

}  // namespace kiroku::archive
