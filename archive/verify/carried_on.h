// One operation in two cases: the recorder died, and after its recovery a new case carries the first one on
// (docs/reference/format-recovery.md, "A case that carries another on"). Both statements are texts of format
// 1, so that a verifier that does not know them judges both cases as it always did. Pure functions,
// thread-safe, but for check_carrying_on().
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/file_reading.h"
#include "archive/format/ledger_entry.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

class CaseFolder;
class FindingList;

/// The earlier case as the later one names it: its first `size` entries have `root`.
struct CarriedOn {
  std::string case_id;
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
};

/// Whether it is the stream of marks, whose `source` names the earlier case.
bool is_events(const StreamInfo& stream);
/// `source` of the later case's stream of events: "operator; carries on case ID, N entries, root HEX".
std::string source_carrying_on(const CarriedOn& earlier);
/// What `open` says of an earlier case; nothing where it says nothing.
std::optional<CarriedOn> carried_on_by(const OpenEntry& open);

/// `reason` of the earlier case's `close`: "recovered; to be carried on as case ID". The later case does not
/// exist yet, and may never come to be.
std::string reason_to_be_carried_on(const std::string& later_case);
/// The case that `close` announces; nothing where it announces none.
std::optional<std::string> announced_by(const std::string& close_reason);

/// Whether the case that `open` says it carries on lies beside `folder`, announces just this case under a
/// checkpoint of `device`, and has the same plan. With the same subject, too, `open` brings nothing that was
/// not there; another one may be what became known while the earlier case ran, or anybody's.
enum class Announced { kNo, kWithOtherSubject, kYes };
/// Throws kiroku::Error where something lies there and cannot be read.
Announced announced_by_earlier(const std::filesystem::path& folder, const OpenEntry& open,
                               const crypto::VerifierKey& device, const FileReading& files = real_reading());

/// Compares a case with the one before it and the one after it, where they lie beside it in one archive
/// folder. Reads their ledgers twice each at most, in constant memory. `folder` is the case's, `open` and
/// `close_reason` ("" where there is none) are what its ledger says, `devices` are those whose further keys
/// are known. Anybody can put something into the place of another case: only lines that the device of `open`
/// signed there speak against this one.
void check_carrying_on(const CaseFolder& folder, const OpenEntry& open, const std::string& close_reason,
                       const std::vector<crypto::VerifierKey>& devices, FindingList& findings);

}  // namespace kiroku::archive
