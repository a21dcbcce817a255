// What a store had of a case of which it has no end, as another device states it (docs/reference/format.md,
// "Cases that only a store has"): the text of a signed note of that device. The case itself is neither
// changed nor signed. Pure functions; thread-safe.
//
//   kiroku/or-2/store-statement            the maker's name
//   case 20260805T091502Z-3f9c21ab
//   device or-1+1a2b3c4d+AbC...            the case's own device, as `open` names it
//   store https://store.example/recordings/or-1
//   looked 2026-08-05T17:00:00.000000Z     by the maker's clock
//   newest 2026-08-05T11:40:17.000000Z     when the newest object had been put, by the store's; or `unknown`
//   log 57 <root, base64>                  the maker's appliance log, before it states this
//   entries 42 <root, base64>              of the ledger, whole lines
//   signed 40 <root, base64>               of them, those that the case's device signed
//   file <SHA-256, hexadecimal>  checkpoints/00000040.note
//   missing segments/room/00000003.ts.age
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/utc_time.h"
#include "crypto/hash.h"

namespace kiroku::archive {

/// In the archive beside the cases, and in a store below an appliance's name: store-statements/<case>/.
inline constexpr std::string_view kStoreStatementsFolder = "store-statements";
/// Of ten hours with a checkpoint a minute a statement has 70 kB. What is longer is none, as no signed note
/// is (crypto/note_format.cpp).
inline constexpr std::size_t kMaximumStoreStatementBytes = 1'000'000;
/// So many statements of one case are read, and so many tokens of each.
inline constexpr std::size_t kMostStoreStatements = 100, kMostTokensOfStatement = 8;

/// How many of a ledger's first lines, and the tree's root over them.
struct LinesOfLedger {
  std::uint64_t size = 0;
  crypto::Sha256Digest root{};
  friend bool operator==(const LinesOfLedger&, const LinesOfLedger&) = default;
};

struct StoreStatement {
  std::string maker;    // the device's name
  std::string case_id;  // and what follows as in the example above
  std::string device;
  std::string store;
  UtcTime looked;
  std::optional<UtcTime> newest;
  LinesOfLedger log, entries, signed_entries;
  struct File {
    std::string path;
    crypto::Sha256Digest sha256{};
    friend bool operator==(const File&, const File&) = default;
  };
  /// Beside the ledger, what its lines do not name and may be of the case: by their paths, each once.
  std::vector<File> files;
  std::vector<std::string> missing;  // what the lines name, and the store had not; by their paths, each once

  [[nodiscard]] std::string to_text() const;
  /// Whether the other one says the same of the store's contents, whoever says it and when.
  [[nodiscard]] bool says_the_same(const StoreStatement& other) const;
};

/// What the text of a note says; nothing for any other text than to_text() gives.
std::optional<StoreStatement> parse_store_statement(std::string_view text);
/// The first line of a statement by the device of that name.
std::string store_statement_origin(std::string_view device_name);

/// Where the statements about a case lie: store-statements/<case> beside its folder.
std::filesystem::path store_statements_folder(const std::filesystem::path& case_folder,
                                              const std::string& case_id);
/// "20260805T170000Z-1a2b3c4d.note": when it was looked, and the key identifier of who did.
std::string store_statement_name(UtcTime looked, std::uint32_t key_id);
bool is_store_statement_name(std::string_view name);
/// Of a statement's token, which lies beside it: "20260805T170000Z-1a2b3c4d.swiss.tsr".
bool is_store_statement_token_name(std::string_view name);

/// Whether a statement speaks of the file at all: of the subject, of notes, tokens and segments. The device's
/// key and certificates beside a case are a convenience, and nothing is proven with them.
bool is_of_store_statement(std::string_view path);

}  // namespace kiroku::archive
