#include "archive/verify/store_statements.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/limits.h"
#include "archive/format/line_reader.h"
#include "archive/storage/file_stamps.h"
#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "crypto/merkle_tree.h"
#include "timestamp/token_verifier.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostToldDifferences = 3;

const std::string* file_named_by(const CaseEntryBody& body) {
  if (const auto* open = std::get_if<OpenEntry>(&body)) return open->subject ? &open->subject->file : nullptr;
  if (const auto* segment = std::get_if<SegmentEntry>(&body)) return &segment->file.file;
  if (const auto* token = std::get_if<TokenEntry>(&body)) return &token->file;
  return nullptr;
}

/// A case's folder, as far as statements speak of it.
class CaseContents {
 public:
  /// The tree's roots at each of `sizes` are remembered. Throws kiroku::Error where the ledger cannot be
  /// read, or has fewer than `lines` lines.
  CaseContents(const CaseFolder& folder, std::uint64_t lines, const std::set<std::uint64_t>& sizes)
      : folder_(folder) {
    for (const ListedFile& file : folder.list()) {
      if (file.kind == ListedFile::Kind::kRegular && is_of_store_statement(file.path))
        there_.insert(file.path);
    }
    const FileOpening opening = folder.open_file(kLedgerFile);
    if (!opening.file) throw Error((folder.path() / kLedgerFile).string() + " " + opening.explanation);
    LineReader reader(*opening.file);
    LedgerLine line;
    crypto::MerkleFrontier tree;
    if (sizes.contains(0)) roots_[0] = tree.root();
    while (tree.size() < lines && reader.next(line) && !line.torn) {
      const EntryParse parse = line.too_long ? EntryParse{} : parse_case_entry(line.text);
      if (const std::string* file = parse.entry ? file_named_by(parse.entry->body) : nullptr)
        named_.emplace(*file, tree.size());
      tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
      if (sizes.contains(tree.size())) roots_[tree.size()] = tree.root();
    }
    if (tree.size() != lines) throw Error("the ledger has fewer lines than when it was verified");
    lines_ = {tree.size(), tree.root()};
  }

  [[nodiscard]] const LinesOfLedger& lines() const { return lines_; }
  [[nodiscard]] const std::set<std::string>& there() const { return there_; }
  /// By the path of each file, the first entry that names it.
  [[nodiscard]] const std::map<std::string, std::uint64_t>& named() const { return named_; }
  /// Of as many lines as were asked for; nothing where there are fewer.
  [[nodiscard]] std::optional<crypto::Sha256Digest> root_at(std::uint64_t size) const {
    const auto found = roots_.find(size);
    return found == roots_.end() ? std::nullopt : std::optional(found->second);
  }

  /// The file's SHA-256; nothing of what is longer than anything sealed. Throws kiroku::Error.
  std::optional<crypto::Sha256Digest> hash_of(const std::string& path) {
    const auto known = hashes_.find(path);
    if (known != hashes_.end()) return known->second;
    const FileOpening opening = folder_.open_file(path);
    if (!opening.file) throw Error((folder_.path() / path).string() + " " + opening.explanation);
    std::optional<crypto::Sha256Digest> hash;
    if (opening.file->size() <= kMaximumSealedBytes) {
      constexpr std::size_t kBytesAtOnce = 1U << 20U;
      crypto::Sha256 hasher;
      std::vector<std::byte> buffer(kBytesAtOnce);
      std::uint64_t read = 0;
      while (const std::size_t count = opening.file->read_at(read, buffer)) {
        hasher.update(ByteView(buffer).first(count));
        read += count;
      }
      opening.file->require_read_to_end(read);
      hash = hasher.finish();
    }
    hashes_.emplace(path, hash);
    return hash;
  }

 private:
  const CaseFolder& folder_;
  LinesOfLedger lines_;
  std::set<std::string> there_;
  std::map<std::string, std::uint64_t> named_;
  std::map<std::uint64_t, crypto::Sha256Digest> roots_;
  std::map<std::string, std::optional<crypto::Sha256Digest>> hashes_;
};

/// What is compared of a statement, which is up to a megabyte.
void leave_out_lists(StoreStatement& statement) {
  statement.files = {};
  statement.missing = {};
}

/// Who signed a statement, and what that is worth.
void judge_signature(const std::string& note, const crypto::VerifierKey& device, const VerifyOptions& options,
                     JudgedStatement& judged) {
  std::vector<crypto::VerifierKey> signers;
  std::ranges::copy_if(options.devices, std::back_inserter(signers), [&](const crypto::VerifierKey& each) {
    return each.name() == judged.statement->maker;
  });
  const crypto::OpenedNote opened = crypto::open_note(note, signers);
  if (opened.failure == crypto::NoteFailure::kUnknownKey) return;
  if (opened.failure) {
    judged.refusal = opened.explanation;
  } else if (device.name() == judged.statement->maker &&
             crypto::open_note(note, {device}).failure != crypto::NoteFailure::kUnknownKey) {
    judged.refusal = "the case's own device signed it, which brings its cases to their ends itself";
  } else {
    judged.is_trusted = true;
  }
}

/// The earliest valid token beside it; one of an outside authority, where there is any.
void judge_time(const FileReading& files, const fs::path& file, const crypto::Sha256Digest& sha256,
                const std::vector<std::string>& names, const VerifyOptions& options,
                JudgedStatement& judged) {
  if (options.trust == nullptr) return;
  const std::string stem = file.stem().string() + ".";
  std::size_t looked_at = 0;
  for (const std::string& name : names) {
    if (!name.starts_with(stem) || !is_store_statement_token_name(name)) continue;
    if (looked_at++ == kMostTokensOfStatement) break;
    std::optional<std::string> token;
    try {
      token = read_small(files.open_to_read(file.parent_path() / name), kMaximumTokenBytes);
    } catch (const Error&) {
      continue;  // the statement is then without this token, which is told as any other absence
    }
    if (!token) continue;
    const timestamp::TokenJudgement answer =
        timestamp::judge_token(bytes_of(*token), expectation_of(sha256), *options.trust);
    if (answer.code != timestamp::TokenCode::kValid) continue;
    const bool outside = answer.authority == timestamp::TimeAuthority::kOutside;
    const UtcTime time = answer.info->gen_time;
    if (judged.existed_at && (judged.by_outside != outside ? judged.by_outside : *judged.existed_at <= time))
      continue;
    judged.existed_at = time;
    judged.by_outside = outside;
    judged.authority = answer.root_subject;
  }
}

/// What is not as the statement says, and what came since.
void compare(CaseContents& contents, JudgedStatement& judged) {
  const StoreStatement& stated = *judged.statement;
  const auto differs = [&](const std::string& sentence) { judged.differences.push_back(sentence); };
  const std::string lines = counted(stated.entries.size, "entry", "entries");
  if (contents.lines().size < stated.entries.size) {
    differs("the store had " + lines + " then, and here are " + std::to_string(contents.lines().size));
  } else if (contents.root_at(stated.entries.size) != stated.entries.root) {
    differs("the first " + lines + " are not those that the store had then");
  } else if (contents.root_at(stated.signed_entries.size) != stated.signed_entries.root) {
    differs("it states a root of its first " + counted(stated.signed_entries.size, "entry", "entries") +
            " that is not theirs");
  }
  std::set<std::string> known;
  for (const StoreStatement::File& file : stated.files) {
    known.insert(file.path);
    if (!contents.there().contains(file.path)) {
      differs(file.path + " was there then, and is missing here");
    } else {
      try {
        if (contents.hash_of(file.path) != file.sha256)
          differs(file.path + " is not the file that was there then");
      } catch (const Error& error) {  // whatever else was stated is compared all the same
        differs(file.path + " cannot be compared: " + error.what());
      }
    }
  }
  judged.later_entries = contents.lines().size - std::min(contents.lines().size, stated.entries.size);
  for (const std::string& path : contents.there()) {
    const auto named = contents.named().find(path);
    const bool was_named = named != contents.named().end() && named->second < stated.entries.size &&
                           !std::ranges::binary_search(stated.missing, path);
    if (!known.contains(path) && !was_named) ++judged.later_files;
  }
}

std::string words_of_time(const JudgedStatement& judged) {
  const std::string looked =
      "it looked at " + format_utc(judged.statement->looked) + " by its own clock, and ";
  if (!judged.existed_at) return looked + "no time-stamp that holds says when it stated this";
  if (judged.by_outside)
    return looked + "stated this by " + format_utc(*judged.existed_at) + ", as " + judged.authority + " says";
  return looked + "stated this by " + format_utc(*judged.existed_at) +
         ", as its own authority says, behind which no outside clock stands";
}

}  // namespace

StoreStatement describe_for_statement(const CaseFolder& folder, std::uint64_t lines,
                                      std::uint64_t signed_size) {
  CaseContents contents(folder, lines, {signed_size});
  StoreStatement statement;
  statement.entries = contents.lines();
  const auto root = contents.root_at(signed_size);
  if (!root) throw Error("the ledger has fewer lines than were signed: it changed meanwhile");
  statement.signed_entries = {signed_size, *root};
  for (const std::string& path : contents.there()) {
    if (contents.named().contains(path)) continue;
    const std::optional<crypto::Sha256Digest> hash = contents.hash_of(path);
    if (!hash) throw Error((folder.path() / path).string() + " is longer than any file of a case");
    statement.files.push_back({path, *hash});
  }
  for (const auto& each : contents.named()) {
    if (is_of_store_statement(each.first) && !contents.there().contains(each.first))
      statement.missing.push_back(each.first);
  }
  return statement;
}

std::vector<JudgedStatement> judge_store_statements(const CaseFolder& folder, const StatedCase& of,
                                                    const VerifyOptions& options) {
  const FileReading& files = options.files != nullptr ? *options.files : real_reading();
  const fs::path beside = store_statements_folder(folder.path(), of.case_id);
  if (!files.exists(beside) || !files.is_folder(beside.parent_path()) || !files.is_folder(beside)) return {};
  const std::vector<std::string> names = files.names_in(beside);
  std::vector<JudgedStatement> all;
  std::set<std::uint64_t> sizes;
  for (const std::string& name : names) {
    if (!is_store_statement_name(name)) continue;
    const bool is_beyond = all.size() == kMostStoreStatements;
    JudgedStatement& judged = all.emplace_back();
    judged.file = name;
    if (is_beyond) {
      judged.refusal = "it and what lies behind it was not read, after " +
                       std::to_string(kMostStoreStatements) + " others";
      break;
    }
    std::optional<std::string> note;
    try {
      note = read_small(files.open_to_read(beside / name), kMaximumStoreStatementBytes);
    } catch (const Error& error) {
      judged.refusal = error.what();
      continue;
    }
    if (note) judged.statement = parse_store_statement(crypto::open_note(*note, {}).text);
    if (!judged.statement) {
      judged.refusal = "it is no signed statement";
    } else if (judged.statement->case_id != of.case_id || judged.statement->device != of.device.to_string()) {
      judged.refusal = "it is of another case, or of another device's";
    } else {
      judge_signature(*note, of.device, options, judged);
    }
    if (!judged.is_trusted) {
      if (judged.statement) leave_out_lists(*judged.statement);
      continue;
    }
    judge_time(files, beside / name, crypto::sha256(bytes_of(*note)), names, options, judged);
    sizes.insert(judged.statement->entries.size);
    sizes.insert(judged.statement->signed_entries.size);
  }
  if (sizes.empty()) return all;
  CaseContents contents(folder, of.lines, sizes);
  for (JudgedStatement& judged : all) {
    if (judged.is_trusted) compare(contents, judged);
  }
  return all;
}

void check_store_statements(const CaseFolder& folder, const StatedCase& of, const VerifyOptions& options,
                            FindingList& findings) {
  std::vector<JudgedStatement> all;
  try {
    all = judge_store_statements(folder, of, options);
  } catch (const Error& error) {
    findings.add("store-statement-refused", {std::string(kStoreStatementsFolder)},
                 std::string("what other devices state of this case could not be read: ") + error.what());
    return;
  }
  for (const JudgedStatement& judged : all) {
    if (!judged.refusal.empty()) {
      findings.add("store-statement-refused", {judged.file},
                   judged.file + " says nothing of this case: " + judged.refusal);
      continue;
    }
    const StoreStatement& stated = *judged.statement;
    // Whoever wrote it chose them.
    const std::string maker = in_quotation_marks(stated.maker), store = in_quotation_marks(stated.store);
    if (!judged.is_trusted) {
      findings.add(
          "store-statement-untrusted", {judged.file},
          judged.file +
              ", which no device that is trusted signed, states what a store had of this case: anybody can "
              "write such a file, here in the name of " +
              maker);
      continue;
    }
    if (!judged.holds()) {
      std::string told;
      for (std::size_t at = 0; at < std::min(judged.differences.size(), kMostToldDifferences); ++at)
        told += (at == 0 ? "" : "; ") + judged.differences[at];
      if (judged.differences.size() > kMostToldDifferences)
        told += "; and " + std::to_string(judged.differences.size() - kMostToldDifferences) + " more";
      findings.add("store-statement-differs", {judged.file},
                   "what device " + maker + " states in " + judged.file + " of " + store +
                       " is not what is here: " + told + ". " + words_of_time(judged));
      continue;
    }
    const std::string had = counted(stated.entries.size, "entry", "entries");
    findings.add("store-statement-holds", {judged.file},
                 "device " + maker + ", and not the case's own, states in " + judged.file + " that " + store +
                     " had " + had + " of this case, the first " +
                     std::to_string(stated.signed_entries.size) + " signed by its device, and " +
                     counted(stated.files.size(), "file", "files") + " that no entry names, and no more: " +
                     words_of_time(judged) + ". The case has no better verdict by that");
    if (judged.later_entries > 0 || judged.later_files > 0) {
      findings.add("store-statement-outgrown",
                   {std::string(kLedgerFile),
                    judged.later_entries > 0 ? std::optional(stated.entries.size) : std::nullopt},
                   "since device " + maker + " stated in " + judged.file + " what " + store +
                       " had of this case, " + counted(judged.later_entries, "entry", "entries") + " and " +
                       counted(judged.later_files, "file", "files") + " came to it");
    }
  }
}

}  // namespace kiroku::archive
