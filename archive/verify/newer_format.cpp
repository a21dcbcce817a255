#include "archive/verify/newer_format.h"

#include <charconv>
#include <string>
#include <variant>

#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/format/limits.h"
#include "archive/format/line_reader.h"
#include "archive/format/strict_json.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/finding_codes.h"
#include "archive/verify/verdict.h"
#include "base/printable.h"
#include "crypto/merkle_tree.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

namespace {

/// "kiroku-case/2", where `known` is "kiroku-case/1"; nothing where the text names no later version.
std::optional<std::string> newer_format(std::string_view json, std::string_view known) {
  const JsonParse parse = parse_json(json, {kMaximumExcerptBytes, 4});
  const auto* object = parse.value ? std::get_if<JsonObject>(&parse.value->content()) : nullptr;
  if (object == nullptr) return std::nullopt;
  constexpr std::size_t kMostDigits = 9;
  const std::string_view name = known.substr(0, known.find('/') + 1);
  for (const auto& [key, value] : *object) {
    const auto* text = key == "format" ? std::get_if<std::string>(&value.content()) : nullptr;
    if (text == nullptr || !text->starts_with(name)) continue;
    const std::string_view digits = std::string_view(*text).substr(name.size());
    unsigned version = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), version);
    const bool is_number = error == std::errc() && end == digits.data() + digits.size() &&
                           digits.size() <= kMostDigits && digits.front() != '0';
    if (is_number && version > 1) return *text;
  }
  return std::nullopt;
}

/// The root that the note of this size states, by one of the devices, or by anybody where none is known:
/// whoever has no key must not make what was changed into something that cannot be checked.
std::optional<crypto::Sha256Digest> stated_root(const CaseFolder& folder, std::uint64_t size,
                                                const std::vector<crypto::VerifierKey>& devices) {
  FindingList nobody_asks;
  const auto note = read_note(folder, size, std::nullopt, nobody_asks);
  if (!note) return std::nullopt;
  const crypto::OpenedNote opened = crypto::open_note(*note, devices);
  using crypto::NoteFailure;
  const bool is_theirs = !opened.failure || *opened.failure == NoteFailure::kLacksMlDsa ||
                         *opened.failure == NoteFailure::kLacksHardware;
  if (!devices.empty() && !is_theirs) return std::nullopt;
  const auto checkpoint = crypto::Checkpoint::parse(opened.text);
  return checkpoint ? std::optional(checkpoint->root) : std::nullopt;
}

VerificationReport report_of(const std::string& format, std::string_view file) {
  const FindingCode& code = CodeName("format-newer").code();
  VerificationReport report;
  report.findings.push_back({std::string(code.name),
                             code.severity,
                             std::string(file),
                             {},
                             {},
                             std::string(file) + " is of the format " + printable(format) +
                                 ", which is later than version 1, the newest that this program knows: it "
                                 "could not be checked; use a newer version of the program"});
  report.verdict = verdict_of(code.severity);
  return report;
}

}  // namespace

std::optional<VerificationReport> report_on_newer_case(const CaseFolder& folder, const ReadableFile& ledger,
                                                       const std::vector<crypto::VerifierKey>& devices) {
  LineReader reader(ledger);
  LedgerLine line;
  if (!reader.next(line) || line.torn || line.too_long) return std::nullopt;
  const std::optional<std::string> format = newer_format(line.text, OpenEntry::kFormat);
  const std::vector<std::uint64_t> sizes = format ? note_sizes(folder.list()) : std::vector<std::uint64_t>{};
  if (sizes.empty()) return std::nullopt;
  crypto::MerkleFrontier tree;
  do {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
  } while (tree.size() < sizes.front() && reader.next(line) && !line.torn && !line.too_long);
  const bool is_whole =
      tree.size() == sizes.front() && stated_root(folder, sizes.front(), devices) == tree.root();
  return is_whole ? std::optional(report_of(*format, kLedgerFile)) : std::nullopt;
}

std::optional<VerificationReport> report_on_newer_excerpt(const CaseFolder& folder, std::string_view document,
                                                          const std::vector<crypto::VerifierKey>& devices) {
  if (document.ends_with('\n')) {
    if (const auto format = newer_format(document.substr(0, document.size() - 1), kExcerptFormat)) {
      return report_of(*format, kExcerptFile);
    }
  }
  const ExcerptParse parse = parse_excerpt(document);
  const FileOpening opening = folder.open_file(kExcerptOpenFile);
  if (!parse.document || !opening.file) return std::nullopt;
  LineReader reader(*opening.file);
  LedgerLine line;
  if (!reader.next(line) || line.torn || line.too_long) return std::nullopt;
  const std::optional<std::string> format = newer_format(line.text, OpenEntry::kFormat);
  const auto root = format ? stated_root(folder, parse.document->size, devices) : std::nullopt;
  const bool is_its =
      root && crypto::verify_inclusion(crypto::merkle_leaf_hash(bytes_of(line.text)), 0, parse.document->size,
                                       parse.document->open_proof, *root);
  return is_its ? std::optional(report_of(*format, kExcerptOpenFile)) : std::nullopt;
}

}  // namespace kiroku::archive
