// What other devices state of a case that a store had without its end, held against the case (docs/reference/
// format.md, "Cases that only a store has"). No verdict becomes better by it: a case without an end is
// incomplete, whoever says so. Functions; thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/store_statement.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/verify_options.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

/// Of a statement: `entries`, `signed_entries` (the first `signed_size` of them), `files` and `missing`, as
/// they are in the folder, of whose ledger the first `lines` count. Throws kiroku::Error where the ledger, or
/// a file, cannot be read, or is another by now.
StoreStatement describe_for_statement(const CaseFolder& folder, std::uint64_t lines,
                                      std::uint64_t signed_size);

/// The case that statements are held against, as it was verified.
struct StatedCase {
  std::string case_id;
  crypto::VerifierKey device;  // that its first line names
  std::uint64_t lines = 0;     // of the ledger, those that were judged
};

/// A statement as it was judged.
struct JudgedStatement {
  std::string file;  // its name
  /// Nothing of what is none. Of one that is not trusted only who states it of which store: whoever may write
  /// there makes it as long as they like.
  std::optional<StoreStatement> statement;
  std::string refusal;  // why it says nothing of this case, whoever signed it; empty: it may
  bool is_trusted = false;
  std::vector<std::string> differences;  // of a trusted one: what is not as it states, a sentence each
  std::uint64_t later_entries = 0, later_files = 0;  // that came since, of one that holds
  std::optional<UtcTime> existed_at;  // by a valid token over it; of an outside authority where one has any
  bool by_outside = false;
  std::string authority;  // subject of the root that stands behind that

  [[nodiscard]] bool holds() const { return is_trusted && differences.empty(); }
};
/// Those that lie beside the case, by their names; of more than kMostStoreStatements the last says so.
std::vector<JudgedStatement> judge_store_statements(const CaseFolder& folder, const StatedCase& of,
                                                    const VerifyOptions& options);
/// The same, as findings.
void check_store_statements(const CaseFolder& folder, const StatedCase& of, const VerifyOptions& options,
                            FindingList& findings);

}  // namespace kiroku::archive
