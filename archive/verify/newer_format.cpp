#include "archive/verify/newer_format.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <variant>

#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/format/folder_name.h"
#include "archive/format/limits.h"
#include "archive/format/line_reader.h"
#include "archive/format/strict_json.h"
#include "archive/verify/case_evidence.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/log_beside.h"
#include "archive/verify/log_proof.h"
#include "archive/verify/log_rules.h"
#include "archive/verify/outside_notes.h"
#include "archive/verify/verdict.h"
#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "crypto/signed_note.h"

namespace kiroku::archive {

namespace {

/// What a first line of a later version says that is read: where it is as in this version.
struct NewerLine {
  std::string format;  // "kiroku-case/2"
  std::optional<crypto::VerifierKey> device;
  struct LogState {
    std::uint64_t size = 0;
    crypto::Sha256Digest root{};
  };
  std::optional<LogState> log;
};

template <typename Kind>
const Kind* member(const JsonObject& object, std::string_view key) {
  const auto found = std::ranges::find(object, key, &JsonObject::value_type::first);
  return found == object.end() ? nullptr : std::get_if<Kind>(&found->second.content());
}

bool is_later(std::string_view text, std::string_view known) {
  constexpr std::size_t kMostDigits = 9;
  const std::string_view name = known.substr(0, known.find('/') + 1);
  if (!text.starts_with(name)) return false;
  const std::string_view digits = text.substr(name.size());
  unsigned version = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), version);
  const bool is_number = error == std::errc() && end == digits.data() + digits.size() &&
                         digits.size() <= kMostDigits && digits.front() != '0';
  return is_number && version > 1;
}

std::optional<crypto::VerifierKey> key_of(const std::string* text) {
  try {
    return text == nullptr ? std::nullopt : std::optional(crypto::VerifierKey::parse(*text));
  } catch (const UsageError&) {
    return std::nullopt;
  }
}

std::optional<crypto::Sha256Digest> digest_of(std::string_view hex) {
  const std::optional<Bytes> bytes = crypto::from_hex(hex);
  crypto::Sha256Digest digest{};
  if (!bytes || bytes->size() != digest.size()) return std::nullopt;
  std::ranges::copy(*bytes, digest.begin());
  return digest;
}

/// Nothing where the text names no later version than `known`, which is "kiroku-case/1" say.
std::optional<NewerLine> newer_line(std::string_view json, std::string_view known) {
  const JsonParse parse = parse_json(json, {kMaximumExcerptBytes, 4});
  const auto* object = parse.value ? std::get_if<JsonObject>(&parse.value->content()) : nullptr;
  const auto* format = object != nullptr ? member<std::string>(*object, "format") : nullptr;
  if (format == nullptr || !is_later(*format, known)) return std::nullopt;
  NewerLine line{*format, key_of(member<std::string>(*object, "device")), std::nullopt};
  if (const auto* log = member<JsonObject>(*object, "appliance_log")) {
    const auto* size = member<std::int64_t>(*log, "size");
    const auto* root = member<std::string>(*log, "root");
    const auto digest = root != nullptr ? digest_of(*root) : std::nullopt;
    if (size != nullptr && *size >= 0 && digest) line.log = {static_cast<std::uint64_t>(*size), *digest};
  }
  return line;
}

/// A checkpoint of a case, and whose it is: nobody else than the device of its origin can have signed it.
struct Head {
  crypto::Checkpoint checkpoint;
  std::string case_id;                        // "" where nobody is known, and its origin is of no case
  std::optional<crypto::VerifierKey> device;  // nothing where that is not known
};

bool is_signed_by(const std::string& note, const crypto::VerifierKey& device) {
  const crypto::OpenedNote opened = crypto::open_note(note, {device});
  using crypto::NoteFailure;
  return !opened.failure || *opened.failure == NoteFailure::kLacksMlDsa ||
         *opened.failure == NoteFailure::kLacksHardware;
}

/// The case of which a device of this name signs such an origin; "" where it is of none.
std::string case_of(const std::string& origin, std::string_view device_name) {
  const std::string prefix = case_origin(device_name, "");
  const std::string id = origin.starts_with(prefix) ? origin.substr(prefix.size()) : std::string();
  return is_case_id(id) ? id : std::string();
}

/// The note of this size, if one of the devices signed it for a case of its own; where none is known, by
/// anybody: whoever has no key must not make what was changed into something that cannot be checked.
std::optional<Head> read_head(const CaseFolder& folder, std::uint64_t size,
                              const std::vector<crypto::VerifierKey>& devices,
                              const std::optional<crypto::VerifierKey>& named) {
  FindingList nobody_asks;
  const auto note = read_note(folder, size, std::nullopt, nobody_asks);
  if (!note) return std::nullopt;
  auto checkpoint = crypto::Checkpoint::parse(crypto::open_note(*note, {}).text);
  if (!checkpoint) return std::nullopt;
  std::vector<crypto::VerifierKey> signers = devices;
  if (devices.empty() && named) signers.push_back(*named);
  for (const crypto::VerifierKey& each : signers) {
    std::string id = case_of(checkpoint->origin, each.name());
    const crypto::VerifierKey device = known_device(each, devices);
    if (!id.empty() && is_signed_by(*note, device)) return Head{*checkpoint, std::move(id), device};
  }
  if (!devices.empty()) return std::nullopt;
  const std::string& origin = checkpoint->origin;
  const std::size_t begin = origin.find('/');
  const std::size_t end = origin.rfind('/');
  const bool has_name = begin != std::string::npos && begin < end;
  std::string id = has_name ? case_of(origin, origin.substr(begin + 1, end - begin - 1)) : std::string();
  return Head{std::move(*checkpoint), std::move(id), std::nullopt};
}

/// What is compared of something of a later version: heads and numbers of entries, which need no
/// understanding of what the entries say.
class NewerComparison {
 public:
  NewerComparison(const VerifyOptions& options, const NewerLine& line, std::string_view file, Head head)
      : options_(options),
        head_(std::move(head)),
        open_(opening(line)),
        options_of_case_(with_notes_of_logs(options, false)),
        outside_(options.log ? options_of_case_ : options, findings_),
        proof_(options, by_log_),
        log_(head_.case_id.empty() ? LogBeside{} : read_log_beside(options, open_, by_log_)),
        comparison_(log_.contents ? &*log_.contents : nullptr, open_, by_log_,
                    line.log ? LogComparison::Head::kKnown : LogComparison::Head::kUnknown) {
    findings_.add("format-newer", {std::string(file)},
                  std::string(file) + " is of the format " + printable(line.format) +
                      ", which is later than version 1, the newest that this program knows: what its "
                      "entries say, and its files, was not checked; use a newer version of the program");
    if (head_.device) outside_.add_shown(head_.checkpoint.origin, *head_.device);
    if (options.log && head_.case_id.empty()) {
      const VerifyOptions of_log = with_notes_of_logs(options, true);
      OutsideNotes(of_log, by_log_).finish(0, false);
      by_log_.add("log-silent", {"log/" + std::string(kLedgerFile), std::nullopt, std::nullopt, true},
                  "which case it is, and whose, no checkpoint says that a known device signed: whether the "
                  "device's log knows it was not checked");
    }
  }

  void check_first_line(const crypto::Sha256Digest& hash) { comparison_.check_opening(hash); }
  void reached(std::uint64_t size, const RootTest& fits) {
    outside_.reached(size, fits, true);
    proof_.reached(size, fits);
    if (comparison_.asks_for(size)) comparison_.reached(size, fits);
  }
  /// The case has `entries` lines; `whole`: they were read to their end.
  void finish(std::uint64_t entries, bool whole) {
    entries_ = entries;
    outside_.finish(entries, whole);
    proof_.finish({head_.case_id, head_.device}, entries, whole);
    if (whole) comparison_.finish_unread(entries);
  }
  void finish_part(std::uint64_t size, const std::optional<crypto::Sha256Digest>& root) {
    outside_.finish(size, false);
    proof_.finish_part({head_.case_id, head_.device}, size, root);
  }
  FindingList& findings() { return findings_; }
  [[nodiscard]] const Head& head() const { return head_; }

  /// `covered`: so many entries a checkpoint covers. Where it covers all of them it covers their end.
  VerificationReport report(std::uint64_t covered) {
    comparison_.settle(covered, entries_ > 0 ? std::optional(entries_ - 1) : std::nullopt);
    VerificationReport report;
    report.case_id = head_.case_id;
    if (head_.device) report.device = head_.device->to_string();
    report.in_log = comparison_.told();
    take_log_findings(by_log_, options_, findings_);
    report.verdict = verdict_of(findings_.worst());
    report.findings = findings_.take();
    return report;
  }

 private:
  /// As far as a log is compared with it.
  [[nodiscard]] std::optional<OpenEntry> opening(const NewerLine& line) const {
    OpenEntry open;
    open.case_id = head_.case_id;
    open.device = head_.device ? head_.device->to_string() : std::string();
    open.appliance_log_size = line.log ? line.log->size : 0;
    open.appliance_log_root = line.log ? line.log->root : crypto::MerkleFrontier().root();
    return open;
  }

  const VerifyOptions& options_;
  FindingList findings_, by_log_;
  Head head_;
  std::optional<OpenEntry> open_;
  VerifyOptions options_of_case_;  // without the notes of logs
  OutsideNotes outside_;
  LogProof proof_;
  LogBeside log_;
  LogComparison comparison_;
  std::uint64_t entries_ = 0;
};

constexpr std::uint64_t kAll = std::numeric_limits<std::uint64_t>::max();

/// The case's own checkpoints: that lines are not those that the device signed, or lack. What else is amiss
/// with one may be right in that version.
class OwnCheckpoints {
 public:
  OwnCheckpoints(const CaseFolder& folder, const VerifyOptions& options,
                 const std::vector<ListedFile>& listing, const Head& head)
      : is_known_(head.device.has_value()),
        rules_(folder, options, found_, note_sizes(listing), are_notes_listed(listing)) {
    if (is_known_) {
      rules_.set_signer(known_device(*head.device, options.devices), head.checkpoint.origin, {kAll, kAll});
    }
  }
  void reached(std::uint64_t size, const RootTest& fits) {
    if (is_known_) rules_.reached(size, fits, true, std::nullopt);
  }
  void finish(std::uint64_t entries, FindingList& findings) {
    if (!is_known_) return;
    rules_.finish(entries);
    for (Finding& each : found_.take()) {
      Place place{each.file, each.entry, each.offset};
      if (each.code == "ledger-changed") findings.add("ledger-changed", std::move(place), each.text);
      if (each.code == "ledger-cut") findings.add("ledger-cut", std::move(place), each.text);
    }
  }
  [[nodiscard]] std::uint64_t covered() const { return is_known_ ? rules_.covered() : 0; }

 private:
  bool is_known_;
  FindingList found_;
  CheckpointRules rules_;
};

void check_folder_name(const CaseFolder& folder, const std::string& case_id, FindingList& findings) {
  const std::string name = folder_name(folder.path());
  if (!case_id.empty() && is_case_id(name) && name != case_id) {
    findings.add("folder-of-another-case", {},
                 "the folder is called by the identifier of case " + name + ", and what lies in it is case " +
                     case_id + ": nothing here is of " + name);
  }
}

std::vector<std::pair<std::uint64_t, Head>> heads_of(const CaseFolder& folder,
                                                     const std::vector<crypto::VerifierKey>& devices,
                                                     const std::optional<crypto::VerifierKey>& named) {
  std::vector<std::pair<std::uint64_t, Head>> heads;
  for (const std::uint64_t size : note_sizes(folder.list())) {
    auto head = read_head(folder, size, devices, named);
    if (head && head->checkpoint.size == size) heads.emplace_back(size, std::move(*head));
  }
  // All are of one case: that of the largest.
  if (!heads.empty()) {
    const std::string origin = heads.back().second.checkpoint.origin;
    const std::optional<crypto::VerifierKey> device = heads.back().second.device;
    std::erase_if(heads, [&](const auto& each) {
      return each.second.checkpoint.origin != origin || each.second.device != device;
    });
  }
  return heads;
}

/// Of an excerpt its checkpoints alone tell of its case: `first_line`, where that is proved to be the case's.
VerificationReport compare_excerpt(const CaseFolder& folder, const VerifyOptions& options,
                                   const NewerLine& line, std::string_view file,
                                   const std::optional<crypto::Sha256Digest>& first_line) {
  // Nothing of a checkpoint that nobody known signed says anything.
  const auto heads = options.devices.empty() ? std::vector<std::pair<std::uint64_t, Head>>{}
                                             : heads_of(folder, options.devices, line.device);
  NewerComparison comparison(options, line, file, heads.empty() ? Head{} : heads.back().second);
  if (first_line && !heads.empty()) comparison.check_first_line(*first_line);
  for (const auto& [size, head] : heads) {
    const crypto::Sha256Digest& own = head.checkpoint.root;
    comparison.reached(size, [&own](const crypto::Sha256Digest& root) { return root == own; });
  }
  const std::uint64_t last = heads.empty() ? 0 : heads.back().first;
  comparison.finish_part(last,
                         heads.empty() ? std::nullopt : std::optional(heads.back().second.checkpoint.root));
  return comparison.report(last);
}

}  // namespace

std::optional<VerificationReport> report_on_newer_case(const CaseFolder& folder, const ReadableFile& ledger,
                                                       const VerifyOptions& options) {
  LineReader first(ledger);
  LedgerLine line;
  if (!first.next(line) || line.torn || line.too_long || !newer_line(line.text, OpenEntry::kFormat)) {
    return std::nullopt;
  }
  // A recorder may go on meanwhile: the folder is listed before the lines are read.
  const std::vector<ListedFile> listing = folder.list();
  const FileOpening opening = folder.open_file(kLedgerFile);
  if (!opening.file) return std::nullopt;
  LineReader reader(*opening.file);
  if (!reader.next(line) || line.torn || line.too_long) return std::nullopt;
  const std::optional<NewerLine> newer = newer_line(line.text, OpenEntry::kFormat);
  const std::vector<std::uint64_t> sizes = newer ? note_sizes(listing) : std::vector<std::uint64_t>{};
  if (sizes.empty()) return std::nullopt;
  const auto smallest = read_head(folder, sizes.front(), options.devices, newer->device);
  if (!smallest || smallest->checkpoint.size != sizes.front()) return std::nullopt;
  const crypto::Sha256Digest first_line = crypto::sha256(bytes_of(line.text));
  crypto::MerkleFrontier tree;
  do {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
  } while (tree.size() < sizes.front() && reader.next(line) && !line.torn && !line.too_long);
  if (tree.size() != sizes.front() || tree.root() != smallest->checkpoint.root) return std::nullopt;

  NewerComparison comparison(options, *newer, kLedgerFile, *smallest);
  OwnCheckpoints own(folder, options, listing, *smallest);
  check_folder_name(folder, smallest->case_id, comparison.findings());
  comparison.check_first_line(first_line);
  LineReader again(*opening.file);
  crypto::MerkleFrontier lines;
  const auto fits = [&](const crypto::Sha256Digest& root) { return root == lines.root(); };
  line = {};
  while (again.next(line) && !line.torn && !line.too_long) {
    lines.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
    own.reached(lines.size(), fits);
    comparison.reached(lines.size(), fits);
  }
  const bool whole = !line.too_long;  // a longer line may be right in that version
  if (whole) own.finish(lines.size(), comparison.findings());
  comparison.finish(lines.size(), whole);
  return comparison.report(own.covered());
}

std::optional<VerificationReport> report_on_newer_excerpt(const CaseFolder& folder, std::string_view document,
                                                          const VerifyOptions& options) {
  if (document.ends_with('\n')) {
    if (const auto newer = newer_line(document.substr(0, document.size() - 1), kExcerptFormat)) {
      return compare_excerpt(folder, options, {newer->format, std::nullopt, std::nullopt}, kExcerptFile,
                             std::nullopt);
    }
  }
  const ExcerptParse parse = parse_excerpt(document);
  const FileOpening opening = folder.open_file(kExcerptOpenFile);
  if (!parse.document || !opening.file) return std::nullopt;
  LineReader reader(*opening.file);
  LedgerLine line;
  if (!reader.next(line) || line.torn || line.too_long) return std::nullopt;
  const std::optional<NewerLine> newer = newer_line(line.text, OpenEntry::kFormat);
  const auto head =
      newer ? read_head(folder, parse.document->size, options.devices, newer->device) : std::nullopt;
  const bool is_its =
      head && crypto::verify_inclusion(crypto::merkle_leaf_hash(bytes_of(line.text)), 0, parse.document->size,
                                       parse.document->open_proof, head->checkpoint.root);
  if (!is_its) return std::nullopt;
  return compare_excerpt(folder, options, *newer, kExcerptOpenFile, crypto::sha256(bytes_of(line.text)));
}

}  // namespace kiroku::archive
