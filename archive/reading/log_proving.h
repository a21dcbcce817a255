// Makes what archive/verify/log_proof.h judges: a .tlog-proof of a case's end in an appliance log. A
// function; thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "archive/verify/verify_options.h"
#include "crypto/signed_note.h"
#include "crypto/tlog_proof.h"

namespace kiroku::archive {

struct MadeLogProof {
  crypto::TlogProof proof;
  std::uint64_t entry = 0;  // of the log
  std::string case_id;
  std::string checkpoint;  // the name of the one that is in it
  crypto::Checkpoint log;  // what that states
  /// The device signed the entry before another followed. Else somebody who could write to the log's disk may
  /// have added it, and a recorder of before signed over it.
  bool signed_then = false;
};
/// Of the case or the excerpt in `folder`, by the log in `log_folder`. The checkpoint is the first of `kept`
/// that the device signed of this very log and that holds the entry; else the log's own newest one. For an
/// excerpt `find_case` gives its case's folder: the way from its lines to the case's end is through others.
/// Throws kiroku::Error where the log does not know the case's end, or only in lines that stood there while
/// it named another device, is not signed over it, or the case is another.
MadeLogProof prove_case_in_log(
    const std::filesystem::path& folder, const std::filesystem::path& log_folder,
    const crypto::VerifierKey& device, const std::vector<OutsideNote>& kept,
    const std::function<std::filesystem::path(const std::string& case_id)>& find_case);

}  // namespace kiroku::archive
