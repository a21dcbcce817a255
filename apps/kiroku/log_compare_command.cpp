#include "apps/kiroku/log_compare_command.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/log_lines.h"
#include "apps/verify/outside_note.h"
#include "apps/verify/verify_command.h"
#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "archive/verify/case_against_log.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/log_histories.h"
#include "base/error.h"
#include "base/json_or_null.h"
#include "base/number_text.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using archive::HistoryComparison;
using archive::HistoryRelation;
using archive::LogHistory;
using nlohmann::ordered_json;

struct Request {
  std::string first, second;
  std::vector<std::string> devices;
  std::optional<std::string> home;
  bool json = false;
};

/// The folder of the log that a person means: it, its archive or its home.
std::optional<fs::path> log_folder_of(const fs::path& named) {
  std::error_code ignored;
  if (!fs::is_directory(named, ignored)) return std::nullopt;
  for (const fs::path& folder : {named, Home(named).log_folder(), named / "log"}) {
    if (fs::exists(folder / archive::kLedgerFile, ignored)) return folder;
  }
  return named;
}

/// One of the two as it was given, and what can be told of it alone.
struct Side {
  std::optional<fs::path> folder;  // nothing: a kept checkpoint
  LogHistory history;
  bool is_trusted = true;  // one of its keys is among those asked for
  /// Of a log that does not hold: its newest checkpoint beside the other log, in a sentence.
  std::string newest_checkpoint;
  /// Of a log that is one history with the other: its entries from here on nobody signed, in neither of them.
  std::optional<std::uint64_t> unsigned_from;

  /// More than what a recorder leaves that was stopped in between.
  [[nodiscard]] bool rests_on_nobody() const { return unsigned_from && history.tail_unsigned; }
};

Side read_side(const std::string& named) {
  if (const auto folder = log_folder_of(named))
    return {folder, archive::read_history(*folder, {}), true, "", {}};
  std::error_code ignored;
  if (!fs::is_regular_file(named, ignored)) {
    throw UsageError("cannot compare " + named + ": it is " +
                     (fs::exists(named, ignored) ? "neither a folder nor a file" : "not there") +
                     "; give the folder of a log, a home, or a checkpoint that was kept");
  }
  return {std::nullopt, archive::history_of_note(load_outside_note(named)), true, "", {}};
}

/// Whether one of these keys signed a checkpoint of it: whom its lines name anybody can write.
bool is_of_one_of(const LogHistory& history, const std::vector<crypto::VerifierKey>& devices) {
  return std::ranges::any_of(devices, [&](const crypto::VerifierKey& key) {
    return std::ranges::find(history.log.devices, key.to_string()) != history.log.devices.end();
  });
}

/// From where on nobody signed a log that is one history with the other one.
std::optional<std::uint64_t> unsigned_from(const Side& side, const Side& other,
                                           const HistoryComparison& comparison) {
  const bool is_one = comparison.relation == HistoryRelation::kSame ||
                      comparison.relation == HistoryRelation::kFirstBegins ||
                      comparison.relation == HistoryRelation::kSecondBegins;
  if (!side.folder || !is_one) return std::nullopt;
  // A checkpoint that was kept covers what is common, as the other log's do as far as that goes.
  const std::uint64_t by_other =
      other.folder ? std::min(other.history.covered(), *comparison.common) : *comparison.common;
  const std::uint64_t covered = std::max(side.history.covered(), by_other);
  if (covered >= side.history.log.lines.size()) return std::nullopt;
  return covered;
}

/// The newest checkpoint that lies in a folder and is by a key that is known, or that the other log names.
archive::OutsideNote newest_checkpoint_in(const fs::path& folder, const LogHistory& other,
                                          const std::vector<crypto::VerifierKey>& trusted) {
  const archive::OutsideCopy copy = archive::read_outside_copy(folder);
  std::vector<crypto::VerifierKey> keys = trusted;
  for (const std::string& device : other.log.devices)
    keys.push_back(archive::known_device(crypto::VerifierKey::parse(device), trusted));
  if (auto note = archive::newest_signed_note(copy, keys)) return std::move(*note);
  if (!copy.notes.empty()) {
    const archive::OutsideCopy::Note& last = copy.notes.back();
    if (auto text = archive::text_of_note(copy, last)) return {(folder / last.file).string(), *text};
  }
  throw Error("no signed checkpoint lies in " + folder.string());
}

/// What was signed stays signed, whatever became of the lines.
std::string judge_newest_checkpoint(const Side& damaged, const Side& other,
                                    const std::vector<crypto::VerifierKey>& trusted) {
  try {
    const archive::OutsideNote note = newest_checkpoint_in(*damaged.folder, other.history, trusted);
    const HistoryComparison judged =
        archive::compare_histories(archive::history_of_note(note), other.history, trusted);
    switch (judged.relation) {
      case HistoryRelation::kSame:
      case HistoryRelation::kFirstBegins:
        return "its newest checkpoint is of the first " + counted(*judged.common, "entry", "entries") +
               " of " + other.history.name + ": these are what the device signed";
      case HistoryRelation::kForked:
        return judged.two_histories()
                   ? "its newest checkpoint is of other entries than those of " + other.history.name +
                         ", and the device signed both"
                   : "its newest checkpoint is of other entries than those of " + other.history.name;
      default:
        return "its newest checkpoint tells nothing: " + judged.why;
    }
  } catch (const Error& error) {
    return std::string("its newest checkpoint tells nothing: ") + error.what();
  }
}

/// The line of an entry that was compared; nothing where the log changed since.
std::optional<std::string> line_of(const Side& side, std::uint64_t number) {
  std::optional<std::string> line;
  std::uint64_t at = 0;
  archive::for_each_whole_line(*side.folder, [&](std::string_view text) {
    if (at++ == number) line = text;
  });
  const bool is_it = line && crypto::merkle_leaf_hash(bytes_of(*line)) == side.history.log.lines[number];
  return is_it ? line : std::nullopt;
}

/// The entry where a log goes its own way.
struct PartingEntry {
  std::optional<std::string> line;
  std::optional<archive::LogEntry> entry;

  [[nodiscard]] std::string text(std::uint64_t number) const {
    const std::string name = "entry " + std::to_string(number) + ": ";
    if (!line) return name + "the log changed while it was compared";
    if (!entry) return name + "a line that is no entry of a log";
    const std::string details = entry_details(*line);
    return name + format_local(entry->at.utc) + "  " + std::string(archive::type_of(entry->body)) +
           (details.empty() ? "" : "  " + details);
  }
  [[nodiscard]] ordered_json json() const {
    if (!entry) return nullptr;
    return ordered_json::parse(*line);
  }
};

std::optional<PartingEntry> parting_entry(const Side& side, const HistoryComparison& comparison) {
  const bool is_shown = comparison.relation == HistoryRelation::kForked && comparison.common && side.folder;
  if (!is_shown) return std::nullopt;
  PartingEntry parting{line_of(side, *comparison.common), std::nullopt};
  if (parting.line) parting.entry = archive::parse_log_entry(*parting.line).entry;
  return parting;
}

/// Where the checkpoint lies.
std::string file_of(const Side& side, const HistoryComparison::Signer& signer) {
  return side.folder ? (*side.folder / archive::note_path(signer.checkpoint.size)).string()
                     : side.history.name;
}

/// Whether a key that was asked for signed both; any where none was.
bool is_by_one_of(const HistoryComparison& comparison, const std::vector<crypto::VerifierKey>& asked_for) {
  return comparison.two_histories() &&
         (asked_for.empty() || std::ranges::any_of(asked_for, [&](const crypto::VerifierKey& key) {
            return key.to_string() == comparison.first->device;
          }));
}

std::string headline(const HistoryComparison& comparison, const Side& first, const Side& second,
                     const std::vector<crypto::VerifierKey>& asked_for) {
  switch (comparison.relation) {
    case HistoryRelation::kSame:
      return "SAME: both are one history of " + counted(*comparison.common, "entry", "entries") + ".";
    case HistoryRelation::kFirstBegins:
      return "ONE HISTORY: " + second.history.name + " goes on from " + first.history.name +
             ", behind its first " + counted(*comparison.common, "entry", "entries") + ".";
    case HistoryRelation::kSecondBegins:
      return "ONE HISTORY: " + first.history.name + " goes on from " + second.history.name +
             ", behind its first " + counted(*comparison.common, "entry", "entries") + ".";
    case HistoryRelation::kForked:
      if (comparison.two_histories() && !is_by_one_of(comparison, asked_for))
        return "FORKED: one key signed both, and it is not one that was asked for.";
      return comparison.two_histories() ? "TWO HISTORIES: one device signed both, and they cannot be one."
                                        : "FORKED: they part, and nothing shows that one device signed both.";
    case HistoryRelation::kOtherDevices:
      return "NOT COMPARED: " + comparison.why + ".";
    case HistoryRelation::kUnknown:
      break;
  }
  return "COULD NOT TELL: " + comparison.why + ".";
}

/// What the headline leaves open, a sentence a line.
std::vector<std::string> explanations(const HistoryComparison& comparison,
                                      const std::vector<crypto::VerifierKey>& asked_for) {
  std::vector<std::string> sentences;
  if (comparison.relation != HistoryRelation::kForked) return sentences;
  if (comparison.common) {
    sentences.push_back(*comparison.common == 0
                            ? "They differ from their first entries on."
                            : "The first " + counted(*comparison.common, "entry", "entries") +
                                  (*comparison.common == 1 ? " is" : " are") +
                                  " the same. Behind that each goes its own way.");
  } else {
    sentences.emplace_back("Where they part a checkpoint does not tell without its log's lines.");
  }
  if (comparison.two_histories()) {
    sentences.push_back("The key: " + comparison.first->device);
    sentences.emplace_back(
        "Either its holder made both, or its recorder wrote to another disk for a time, or went on from an "
        "older copy that was put back.");
    sentences.emplace_back(
        "If lines of one were changed on the disk and its recorder signed on, it says so itself "
        "(damage-found). No power cut does any of this.");
    if (asked_for.empty()) {
      sentences.emplace_back(
          "Anybody can make a key of any name: whether it is the device's, --device with its own tells.");
    } else if (!is_by_one_of(comparison, asked_for)) {
      sentences.emplace_back(
          "Of the device that was asked for this shows nothing, unless the key is a later one of it: then "
          "give "
          "that with --device.");
    }
  } else if (comparison.first && comparison.second) {
    sentences.emplace_back(
        "Different keys signed them behind that place. Whoever has no key of the device can make the like.");
  } else {
    sentences.emplace_back(
        "Nobody signed what stands behind that place in one of them: whoever can write to a disk can make "
        "it.");
  }
  return sentences;
}

std::string side_text(const Side& side, const std::optional<PartingEntry>& parting,
                      const std::optional<HistoryComparison::Signer>& signer,
                      const HistoryComparison& comparison) {
  const LogHistory& history = side.history;
  std::string text = "\n" + printable(history.name) +
                     (history.note ? ": a checkpoint"
                                   : ": a log of " + counted(history.log.lines.size(), "entry", "entries") +
                                         (history.log.whole ? "" : ", as far as it can be read")) +
                     "\n";
  const auto line = [&](const std::string& sentence) { text += "  " + printable(sentence) + "\n"; };
  if (!history.note) {
    line("device " + (history.log.first_device.empty() ? "none" : history.log.first_device) +
         (side.is_trusted ? "" : " (not signed by the device that was asked for)"));
  }
  if (side.unsigned_from)
    line("nobody signed it from entry " + std::to_string(*side.unsigned_from) +
         " on: whoever can write to a disk can make that");
  if (parting) line(parting->text(*comparison.common));
  if (signer) {
    line("signed: " + file_of(side, *signer) + ", over the first " +
         counted(signer->checkpoint.size, "entry", "entries") + ", root " +
         crypto::to_hex(signer->checkpoint.root) +
         (comparison.two_histories() ? "" : ", by " + signer->device));
  } else if (comparison.relation == HistoryRelation::kForked) {
    line("signed: by nobody, behind that place");
  }
  if (!history.damage.empty()) {
    const std::size_t findings = history.damage.size();
    line("DAMAGED: " + std::to_string(findings) + (findings == 1 ? " finding" : " findings") +
         ", the first: " + history.damage.front().code + ": " + history.damage.front().text);
    if (!side.newest_checkpoint.empty()) line(side.newest_checkpoint);
  }
  return text;
}

ordered_json side_json(const Side& side, const std::optional<PartingEntry>& parting,
                       const std::optional<HistoryComparison::Signer>& signer) {
  const LogHistory& history = side.history;
  ordered_json damage = ordered_json::array();
  for (const archive::Finding& finding : history.damage) {
    damage.push_back({{"code", finding.code},
                      {"file", or_null(finding.file)},
                      {"entry", or_null(finding.entry)},
                      {"text", finding.text}});
  }
  ordered_json object{
      {"path", history.name},
      {"is", history.note ? "checkpoint" : "log"},
      {"entries", history.note ? ordered_json(nullptr) : ordered_json(history.log.lines.size())},
      {"whole", history.note ? ordered_json(nullptr) : ordered_json(history.log.whole)},
      {"device", or_null(history.log.first_device)},
      {"trusted", side.is_trusted},
      {"unsigned_from", or_null(side.unsigned_from)},
      {"damage", damage},
      {"newest_checkpoint", or_null(side.newest_checkpoint)},
      {"entry", parting ? parting->json() : ordered_json(nullptr)},
      {"checkpoint", nullptr}};
  if (signer) {
    object["checkpoint"] = {{"file", file_of(side, *signer)},
                            {"device", signer->device},
                            {"origin", signer->checkpoint.origin},
                            {"size", signer->checkpoint.size},
                            {"root", crypto::to_hex(signer->checkpoint.root)}};
  }
  return object;
}

int run(const Request& request) {
  std::vector<crypto::VerifierKey> asked_for;
  for (const std::string& device : request.devices) {
    for (crypto::VerifierKey& key : load_device_keys(device)) asked_for.push_back(std::move(key));
  }
  std::vector<crypto::VerifierKey> known = asked_for;
  if (asked_for.empty()) {
    if (const auto home = Home::find(request.home)) known.push_back(home->device());
  }
  Side first = read_side(request.first), second = read_side(request.second);
  const HistoryComparison comparison = archive::compare_histories(first.history, second.history, known);
  for (auto [side, other] : {std::pair(&first, &second), std::pair(&second, &first)}) {
    if (!side->history.damage.empty() && other->folder)
      side->newest_checkpoint = judge_newest_checkpoint(*side, *other, known);
    side->is_trusted =
        asked_for.empty() || side->history.note.has_value() || is_of_one_of(side->history, asked_for);
    side->unsigned_from = unsigned_from(*side, *other, comparison);
  }
  const auto parting_first = parting_entry(first, comparison);
  const auto parting_second = parting_entry(second, comparison);
  if (request.json) {
    print_json({{"relation", archive::relation_name(comparison.relation)},
                {"two_histories", comparison.two_histories()},
                {"by_asked_device", asked_for.empty() ? ordered_json(nullptr)
                                                      : ordered_json(is_by_one_of(comparison, asked_for))},
                {"common_entries", or_null(comparison.common)},
                {"why", or_null(comparison.why)},
                {"logs",
                 {side_json(first, parting_first, comparison.first),
                  side_json(second, parting_second, comparison.second)}}});
  } else {
    std::string text = printable(headline(comparison, first, second, asked_for)) + "\n";
    for (const std::string& sentence : explanations(comparison, asked_for))
      text += printable(sentence) + "\n";
    text += side_text(first, parting_first, comparison.first, comparison);
    text += side_text(second, parting_second, comparison.second, comparison);
    std::cout << text;
  }
  const bool is_damaged = !first.history.damage.empty() || !second.history.damage.empty();
  if (is_damaged || is_by_one_of(comparison, asked_for)) return kAnswerIsNo;
  const bool is_told = comparison.relation == HistoryRelation::kSame ||
                       comparison.relation == HistoryRelation::kFirstBegins ||
                       comparison.relation == HistoryRelation::kSecondBegins;
  const bool is_signed = !first.rests_on_nobody() && !second.rests_on_nobody();
  return is_told && is_signed && first.is_trusted && second.is_trusted ? kDone : kNoAnswer;
}

}  // namespace

void add_log_compare_command(Command& log) {
  Command& command =
      log.add_command("compare", "lays two logs side by side: one history, or where they part");
  const auto request = std::make_shared<Request>();
  command.argument("A", request->first,
                   "a log's folder, an archive or a home with one, or a checkpoint that was kept");
  command.argument("B", request->second, "the same");
  command.option(
      "--device", "FILE", request->devices,
      "the recorder's key, a device.pub or the key itself: whether these are its logs is said, too");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "A device signs one history. Where two logs of one device part, and its key signed each behind that "
      "place, its holder told two people different things. The command names the two entries and the two "
      "signed checkpoints: keep both folders.");
  command.explain(
      "A checkpoint that was kept counts where a device signed it that a log beside it names, or that "
      "--device or the home knows. Two checkpoints of one size and different roots prove two histories "
      "without any log.");
  command.explain(
      "Exit status: 0 one history, or the one is the other's beginning; 1 two histories that one device "
      "signed, or a log that does not hold by itself; 2 wrong usage or unreadable; 3 nothing follows: logs "
      "of "
      "different devices, a fork that one device did not sign on both sides, what cannot be told from a "
      "checkpoint alone, a log that nobody signed to its end, or logs and signatures of another device than "
      "--device.");
  command.example("kiroku log compare /mnt/audit-2025/log ~/.local/share/kiroku",
                  "whether the home's log goes on from an exported one");
  command.example("kiroku log compare from-the-insurer/log from-the-court/log --device device.pub",
                  "whether the device told both the same");
  command.example("kiroku log compare receipt.note archive/log",
                  "whether a checkpoint that was kept is of this log");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
