#include "archive/verify/log_histories.h"

#include <algorithm>
#include <map>
#include <string_view>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/line_reader.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/log_rules.h"
#include "base/error.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

using Signer = HistoryComparison::Signer;

std::string origin_of(const std::string& device) {
  return log_origin(crypto::VerifierKey::parse(device).name());
}

crypto::Sha256Digest root_of(const SignedLog& log, std::uint64_t size) {
  crypto::MerkleFrontier tree;
  for (std::uint64_t i = 0; i < size; ++i) tree.append(log.lines[i]);
  return tree.root();
}

Signer signer_of(const SignedLog& log, const SignedLog::Signed& each) {
  const std::string& device = log.devices[each.device];
  return {device, {origin_of(device), each.size, root_of(log, each.size)}};
}

/// The first checkpoint over more than `common` entries; by `device`, where one is asked for.
std::optional<Signer> first_signed(const SignedLog& log, std::uint64_t common,
                                   const std::string* device = nullptr) {
  for (const SignedLog::Signed& each : log.checkpoints) {
    if (each.size > common && (device == nullptr || log.devices[each.device] == *device))
      return signer_of(log, each);
  }
  return std::nullopt;
}

/// Of each device its first checkpoint over more than `common` entries.
std::map<std::string_view, const SignedLog::Signed*> first_of_each(const SignedLog& log,
                                                                   std::uint64_t common) {
  std::map<std::string_view, const SignedLog::Signed*> first;
  for (const SignedLog::Signed& each : log.checkpoints) {
    if (each.size > common) first.try_emplace(log.devices[each.device], &each);
  }
  return first;
}

/// Who signed both behind what is common to them, or each.
void name_signers(const SignedLog& first, const SignedLog& second, std::uint64_t common,
                  HistoryComparison& comparison) {
  const auto of_first = first_of_each(first, common);
  const auto of_second = first_of_each(second, common);
  for (const std::string& device : first.devices) {
    const auto one = of_first.find(device);
    const auto other = of_second.find(device);
    if (one == of_first.end() || other == of_second.end()) continue;
    comparison.first = signer_of(first, *one->second);
    comparison.second = signer_of(second, *other->second);
    return;
  }
  comparison.first = first_signed(first, common);
  comparison.second = first_signed(second, common);
}

HistoryComparison unknown(std::string why, std::optional<std::uint64_t> common = std::nullopt) {
  return {HistoryRelation::kUnknown, common, std::nullopt, std::nullopt, std::move(why)};
}

HistoryComparison other_devices(const std::string& one, const std::string& other) {
  return {HistoryRelation::kOtherDevices, std::nullopt, std::nullopt, std::nullopt,
          "they are of different devices, " + printable(one) + " and " + printable(other)};
}

bool is_named(const SignedLog& log, const std::string& device) {
  return log.first_device == device || std::ranges::find(log.devices, device) != log.devices.end();
}

HistoryComparison compare_logs(const LogHistory& first, const LogHistory& second) {
  const SignedLog& a = first.log;
  const SignedLog& b = second.log;
  const auto parted = std::ranges::mismatch(a.lines, b.lines);
  const auto common = static_cast<std::uint64_t>(parted.in1 - a.lines.begin());
  HistoryComparison comparison;
  comparison.common = common;
  if (parted.in1 != a.lines.end() && parted.in2 != b.lines.end()) {
    name_signers(a, b, common, comparison);
    const bool one_signed_both =
        comparison.first && comparison.second && comparison.first->device == comparison.second->device;
    if (common == 0 && !one_signed_both && a.first_device != b.first_device) {
      for (const LogHistory* const history : {&first, &second}) {
        if (history->log.first_device.empty())
          return unknown(history->name + " names no device in its first entry, so whose it is nobody knows");
      }
      return other_devices(a.first_device, b.first_device);
    }
    comparison.relation = HistoryRelation::kForked;
    return comparison;
  }
  if (common == 0) {
    return unknown((a.lines.empty() ? first : second).name +
                   " shows no entry, and everything begins with none");
  }
  // Whose end is known and reached is the other's beginning.
  const bool first_ends = parted.in1 == a.lines.end() && a.whole;
  const bool second_ends = parted.in2 == b.lines.end() && b.whole;
  if (!first_ends && !second_ends) {
    return unknown("the first " + counted(common, "entry", "entries") +
                       " are the same, and what follows in " +
                       (parted.in1 == a.lines.end() ? first : second).name + " cannot be read",
                   common);
  }
  comparison.relation = first_ends && second_ends ? HistoryRelation::kSame
                        : first_ends              ? HistoryRelation::kFirstBegins
                                                  : HistoryRelation::kSecondBegins;
  return comparison;
}

/// A kept checkpoint that holds, or why it does not.
struct OpenedCheckpoint {
  std::optional<Signer> signer;
  std::string why;
};

OpenedCheckpoint open_kept(const LogHistory& history, const std::vector<std::string>& devices,
                           const std::vector<crypto::VerifierKey>& trusted) {
  const std::string& note = *history.note;
  const auto unjudged = crypto::Checkpoint::parse(crypto::open_note(note, {}).text);
  if (!unjudged) return {std::nullopt, history.name + " is neither a log nor a signed checkpoint of one"};
  for (const std::string& device : devices) {
    if (origin_of(device) != unjudged->origin) continue;
    const crypto::OpenedNote opened =
        crypto::open_note(note, {known_device(crypto::VerifierKey::parse(device), trusted)});
    if (!opened.failure && unjudged->size == 0)
      return {std::nullopt, history.name + " is of no entry, and everything begins with none"};
    if (!opened.failure) return {Signer{device, *unjudged}, ""};
    if (opened.failure == crypto::NoteFailure::kBadSignature ||
        opened.failure == crypto::NoteFailure::kLacksMlDsa ||
        opened.failure == crypto::NoteFailure::kLacksHardware)
      return {std::nullopt, history.name + " does not hold: " + opened.explanation};
  }
  return {std::nullopt, history.name + " is of \"" + printable(unjudged->origin) +
                            "\", and no device that is known here signed it: give its key with --device"};
}

/// `swapped`: the kept checkpoint came first.
HistoryComparison compare_with_kept(const LogHistory& history, const Signer& kept, const std::string& name,
                                    bool swapped) {
  const SignedLog& log = history.log;
  if (!is_named(log, kept.device)) {
    return other_devices(swapped ? kept.device : log.first_device, swapped ? log.first_device : kept.device);
  }
  const std::uint64_t size = kept.checkpoint.size;
  if (size > log.lines.size()) {
    return unknown(name + " is of " + counted(size, "entry", "entries") + ", and " + history.name +
                   " shows " + std::to_string(log.lines.size()) +
                   ": a copy from before, or one whose end was removed; only the lines can tell more");
  }
  HistoryComparison comparison;
  if (root_of(log, size) == kept.checkpoint.root) {
    comparison.common = size;
    const bool all = size == log.lines.size() && log.whole;
    comparison.relation = all       ? HistoryRelation::kSame
                          : swapped ? HistoryRelation::kFirstBegins
                                    : HistoryRelation::kSecondBegins;
    return comparison;
  }
  comparison.relation = HistoryRelation::kForked;
  // One over fewer entries could be of what both have.
  comparison.first = first_signed(log, size - 1, &kept.device);
  if (!comparison.first) comparison.first = first_signed(log, size - 1);
  comparison.second = kept;
  if (swapped) std::swap(comparison.first, comparison.second);
  return comparison;
}

HistoryComparison compare_kept(const LogHistory& first, const Signer& a, const LogHistory& second,
                               const Signer& b) {
  // Two machines may have one name; two checkpoints that are not the same show nothing but that.
  if (a.checkpoint.origin != b.checkpoint.origin || (a.device != b.device && a.checkpoint != b.checkpoint))
    return other_devices(a.device, b.device);
  if (a.checkpoint.size != b.checkpoint.size) {
    return unknown(first.name + " is of " + counted(a.checkpoint.size, "entry", "entries") + " and " +
                   second.name + " of " + std::to_string(b.checkpoint.size) +
                   ": whether one goes on from the other only the log's lines can tell");
  }
  if (a.checkpoint.root == b.checkpoint.root)
    return {HistoryRelation::kSame, a.checkpoint.size, std::nullopt, std::nullopt, ""};
  return {HistoryRelation::kForked, std::nullopt, a, b, ""};
}

}  // namespace

LogHistory read_history(const std::filesystem::path& folder, const VerifyOptions& options) {
  const CaseFolder opened = CaseFolder::open(folder);
  if (const FileOpening ledger = opened.open_file(kLedgerFile); ledger.file) {
    LineReader reader(*ledger.file);
    LedgerLine line;
    if (reader.next(line) && !line.torn && !line.too_long && parse_case_entry(line.text).entry) {
      throw UsageError(folder.string() +
                       " is a case, not an appliance log: 'kiroku verify' judges it, by the log");
    }
  }
  LogHistory history;
  history.name = folder.string();
  FindingList findings;
  LogWalk walk(opened, options, findings, {});
  walk.keep_for_comparison(history.log);
  walk.run();
  history.damage = findings.take();
  history.tail_unsigned = std::ranges::any_of(
      history.damage, [](const Finding& finding) { return finding.code == "log-tail-unsigned"; });
  std::erase_if(history.damage,
                [](const Finding& finding) { return finding.severity != Severity::kTampered; });
  return history;
}

LogHistory history_of_note(const OutsideNote& note) {
  LogHistory history;
  history.name = note.name;
  history.note = note.text;
  return history;
}

std::string_view relation_name(HistoryRelation relation) {
  switch (relation) {
    case HistoryRelation::kSame:
      return "same";
    case HistoryRelation::kFirstBegins:
      return "first-begins";
    case HistoryRelation::kSecondBegins:
      return "second-begins";
    case HistoryRelation::kForked:
      return "forked";
    case HistoryRelation::kOtherDevices:
      return "other-devices";
    case HistoryRelation::kUnknown:
      break;
  }
  return "unknown";
}

HistoryComparison compare_histories(const LogHistory& first, const LogHistory& second,
                                    const std::vector<crypto::VerifierKey>& trusted) {
  std::vector<std::string> devices;
  for (const crypto::VerifierKey& key : trusted) devices.push_back(key.to_string());
  for (const LogHistory* const history : {&first, &second}) {
    devices.insert(devices.end(), history->log.devices.begin(), history->log.devices.end());
    if (!history->log.first_device.empty()) devices.push_back(history->log.first_device);
  }
  if (!first.note && !second.note) return compare_logs(first, second);
  const LogHistory& kept = first.note ? first : second;
  const OpenedCheckpoint opened = open_kept(kept, devices, trusted);
  if (!opened.signer) return unknown(opened.why);
  if (!first.note || !second.note)
    return compare_with_kept(first.note ? second : first, *opened.signer, kept.name, first.note.has_value());
  const OpenedCheckpoint other = open_kept(second, devices, trusted);
  if (!other.signer) return unknown(other.why);
  return compare_kept(first, *opened.signer, second, *other.signer);
}

}  // namespace kiroku::archive
