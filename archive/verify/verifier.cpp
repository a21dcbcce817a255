#include "archive/verify/verifier.h"

#include <algorithm>
#include <array>
#include <set>
#include <string_view>
#include <utility>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/folder_name.h"
#include "archive/format/line_reader.h"
#include "archive/verify/authority_files.h"
#include "archive/verify/carried_on.h"
#include "archive/verify/case_evidence.h"
#include "archive/verify/case_rules.h"
#include "archive/verify/case_witnesses.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/event_marks.h"
#include "archive/verify/excerpt_verifier.h"
#include "archive/verify/file_checker.h"
#include "archive/verify/finding_list.h"
#include "archive/verify/folder_names.h"
#include "archive/verify/found_files.h"
#include "archive/verify/hashing_verifier.h"
#include "archive/verify/log_beside.h"
#include "archive/verify/log_proof.h"
#include "archive/verify/log_rules.h"
#include "archive/verify/newer_format.h"
#include "archive/verify/outside_notes.h"
#include "archive/verify/store_statements.h"
#include "archive/verify/verdict.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

/// `open`, if the first line is one.
std::optional<OpenEntry> read_opening(const ReadableFile& ledger) {
  LineReader reader(ledger);
  LedgerLine line;
  if (!reader.next(line) || line.torn || line.too_long) {
    return std::nullopt;
  }
  EntryParse parse = parse_case_entry(line.text);
  if (!parse.entry || !std::holds_alternative<OpenEntry>(parse.entry->body)) {
    return std::nullopt;
  }
  return std::get<OpenEntry>(std::move(parse.entry->body));
}

/// One run over one case folder.
class CaseVerification {
 public:
  // The folder is listed before the ledger is read: of a case that is being recorded, everything listed then
  // has its entry, apart from what is in the making.
  CaseVerification(const CaseFolder& folder, const VerifyOptions& options, AlsoHash* also)
      : folder_(folder),
        options_(options),
        also_(also),
        listing_(folder.list()),
        checkpoints_(folder, options, findings_, note_sizes(listing_), are_notes_listed(listing_)),
        files_(folder, options, findings_, bytes_in(listing_)),
        rules_(folder, options, findings_, checkpoints_, files_, {}),
        options_of_case_(with_notes_of_logs(options, false)),
        outside_(options.log ? options_of_case_ : options, findings_),
        log_proof_(options, by_log_) {
    if (options.identities == nullptr) return;
    files_.compare_events(marks_);
    rules_.compare_events(marks_);
  }

  VerificationReport run() {
    const FileOpening opening = folder_.open_file(kLedgerFile);
    if (opening.file) {
      walk(*opening.file);
    } else {
      report_unopened(findings_, {std::string(kLedgerFile)}, opening);
      if (options_.log) {
        const VerifyOptions of_log = with_notes_of_logs(options_, true);
        OutsideNotes(of_log, by_log_).finish(0, false);
      }
    }
    if (rules_.opening() && rules_.device()) {
      outside_.add_shown(case_origin(rules_.device()->name(), rules_.opening()->case_id), *rules_.device());
    }
    outside_.finish(tree_.size(), opening.file.has_value() && !rules_.gave_up());
    log_proof_.finish({rules_.opening() ? rules_.opening()->case_id : std::string(), rules_.device()},
                      tree_.size(), opening.file.has_value() && !rules_.gave_up());
    checkpoints_.judge_keys(rules_.claims(), log_proof_.vouched_by(vouched_by_log_));
    return report();
  }

 private:
  void walk(const ReadableFile& ledger) {
    const std::optional<OpenEntry> open = read_opening(ledger);
    if (open) {
      std::vector<crypto::HashAlgorithm> further = further_hashes_of_case(folder_, open->case_id, options_);
      for (std::size_t i = 0; also_ != nullptr && i < also_->algorithms.size(); ++i) {
        const crypto::HashAlgorithm algorithm = also_->algorithms[i];
        if (std::ranges::find(further, algorithm) == further.end()) further.push_back(algorithm);
      }
      files_.also_hash(std::move(further));
    }
    const LogBeside log = read_log_beside(options_, open, by_log_);
    walked_log_ = log.walked;
    LogComparison comparison(log.contents ? &*log.contents : nullptr, open, by_log_);

    const auto fits = [&](const crypto::Sha256Digest& root) { return root == tree_.root(); };
    LineReader reader(ledger);
    LedgerLine line;
    bool tree_known = true;
    outside_.reached(0, fits, tree_known);
    while (!rules_.gave_up() && reader.next(line) && !line.torn) {
      const std::uint64_t number = tree_.size();
      if (was_never_flushed(line, number)) {
        line.torn = true;
        break;
      }
      if (number == 0) {
        comparison.check_opening(crypto::sha256(bytes_of(line.text)));  // of the very line that the tree has
      }
      tree_.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
      tree_known = tree_known && !line.too_long;
      rules_.take(line, number);
      checkpoints_.reached(tree_.size(), fits, tree_known, rules_.last_mono_ns());
      outside_.reached(tree_.size(), fits, tree_known);
      log_proof_.reached(tree_.size(), fits);
      if (comparison.asks_for(tree_.size())) {
        comparison.reached(tree_.size(), fits);
      }
    }
    if (rules_.gave_up()) {
      files_.finish();  // what is missing may be erased later
      return;
    }
    if (tree_.size() == 0) {
      comparison.check_opening({});
    }
    judge_end(line, comparison);
    checkpoints_.finish(tree_.size());
    rules_.finish();
    comparison.finish(tree_.size(), rules_.close_entry().has_value(), rules_.tokens().hashes());
    comparison.settle(checkpoints_.covered(), rules_.close_entry());
    vouched_by_log_ = comparison.vouched_by();
    in_log_ = comparison.told();
    rules_.judge_missing(files_.finish());
    marks_.finish({.is_whole = is_recorded_whole(), .begins_ns = {}, .stretch = {}}, findings_);
    judge_names();
    rules_.check_device_file();
    if (rules_.opening()) {
      check_carrying_on(folder_, *rules_.opening(), rules_.close_reason(), options_.devices, findings_);
    }
  }

  /// Whether the recorder came to its end, so that every mark was entered, and every event written.
  [[nodiscard]] bool is_recorded_whole() const {
    const std::string& reason = rules_.close_reason();
    return rules_.close_entry() && !rules_.recovered() && reason != "disk-full" &&
           !reason.starts_with("error: ");
  }

  /// Zeros where a power cut kept lines from the disk, which the next start cuts off. Nobody signed anything
  /// from here on: cutting it off leaves what cutting off the lines themselves would. Behind `close` a
  /// recorder never has more than a few lines under way.
  [[nodiscard]] bool was_never_flushed(const LedgerLine& line, std::uint64_t number) const {
    const bool may_be = !rules_.close_entry() || !line.too_long;
    return may_be && line.text.find('\0') != std::string::npos && checkpoints_.newest() <= number;
  }

  /// `last` is what the reader stopped at.
  void judge_end(const LedgerLine& last, const LogComparison& log) {
    const std::uint64_t entries = tree_.size();
    const std::optional<std::uint64_t> close = rules_.close_entry();
    const Place end{std::string(kLedgerFile), entries, last.offset};
    if (last.torn && last.bytes > 0) {
      // A line that a checkpoint covers was whole. Behind that a recorder dies in the middle of one, after
      // `close` as before it; nobody signed it, so that nothing is lost with it.
      if (checkpoints_.newest() > entries) {
        findings_.add("ledger-end-damaged", end,
                      "the ledger does not end with a whole line, although a checkpoint covers that line");
      } else if (close && last.too_long) {
        findings_.add("ledger-end-damaged", end,
                      "behind close the ledger holds more than a recorder can have left of a line");
      } else {
        findings_.add("ledger-torn", end,
                      "the last line of the ledger was not written to its end, and no checkpoint covers it");
      }
    }
    if (entries == 0) {
      findings_.add("open-missing", {std::string(kLedgerFile)}, "the ledger holds no whole entry");
    }
    if (!close) {
      findings_.add(
          "not-closed", {std::string(kLedgerFile)},
          "the case was not closed: it is still being recorded, or recording was cut off" +
              (checkpoints_.covered() < entries
                   ? "; nobody has signed the entries from " + std::to_string(checkpoints_.covered()) +
                         " on, so whoever can write to the disk could have made them"
                   : std::string()));
    } else if (checkpoints_.may_cover_more()) {
      return;  // what could not be read is said, and whether it covers the end nobody knows
    } else if (checkpoints_.covered() <= *close) {
      findings_.add(
          "close-not-covered", {std::string(kLedgerFile), close},
          "no checkpoint covers close in entry " + std::to_string(*close) + ": the case was not finished");
    } else if (checkpoints_.covered() < entries && !log.knows_beyond(checkpoints_.covered()) &&
               rules_.tokens().restate_tokens(checkpoints_.covered(), entries)) {
      // What a recorder leaves that dies between a token's entry and the checkpoint over it. Nobody signed
      // these lines, so nothing is believed for their sake: the tokens hold without them, and speak of the
      // checkpoints that they are over. Whoever removes that last checkpoint leaves the same; the appliance
      // log knows.
      findings_.add("token-not-covered", {std::string(kLedgerFile), checkpoints_.covered()},
                    "no checkpoint covers the entries of tokens from " +
                        std::to_string(checkpoints_.covered()) + " on: the case was not finished");
    } else if (checkpoints_.covered() < entries && !log.knows_beyond(checkpoints_.covered()) &&
               rules_.only_aftermath(checkpoints_.covered(), entries)) {
      // Likewise a missed token, which waits for the answers of other authorities, and an erasure. It is
      // signed before the first file goes, so all of them must still be there.
      findings_.add("end-not-covered", {std::string(kLedgerFile), checkpoints_.covered()},
                    "no checkpoint covers the entries of tokens, missed tokens or erasures from " +
                        std::to_string(checkpoints_.covered()) +
                        " on: the case is being brought to its end, or was not finished");
    } else if (checkpoints_.covered() < entries) {
      findings_.add("ledger-not-covered", {std::string(kLedgerFile), checkpoints_.covered()},
                    "no checkpoint covers the entries from " + std::to_string(checkpoints_.covered()) +
                        " on, although the case was closed");
    }
  }

  NameJudgement judge_name(const ListedFile& file) {
    const std::string& path = file.path;
    if (path == kLedgerFile || path == kDeviceFile || rules_.names(path) || is_note_file(file)) {
      return NameJudgement::kNamed;
    }
    if (file.kind == ListedFile::Kind::kFolder) {
      return rules_.is_folder(path) ? NameJudgement::kNamed : NameJudgement::kUnnamed;
    }
    if (is_below_authorities(path)) {
      return judge_authority_file(
          folder_, file, [this](const std::string& name) { return rules_.names_authority(name); }, findings_);
    }
    if (not_entered_.contains(path)) {
      return NameJudgement::kSegmentNotEntered;
    }
    if (const StreamRules* stream = rules_.stream_of_folder(path)) {
      if (stream->may_be_left_over(path)) {
        return path.ends_with(kPartSuffix) ? NameJudgement::kPart : NameJudgement::kSegmentNotEntered;
      }
    }
    if (!rules_.close_entry() || rules_.recovered()) {
      if (may_be_unfinished(file)) {
        return NameJudgement::kPart;
      }
      if (token_of_path(path)) {
        return NameJudgement::kTokenNotEntered;
      }
    }
    return rules_.close_entry() ? judge_after_close(path) : NameJudgement::kUnnamed;
  }

  /// What a recorder may have been writing: a note, a token, a segment of a stream.
  [[nodiscard]] bool may_be_unfinished(const ListedFile& file) const {
    if (file.kind != ListedFile::Kind::kRegular || !file.path.ends_with(kPartSuffix)) {
      return false;
    }
    const std::string whole = file.path.substr(0, file.path.size() - kPartSuffix.size());
    const StreamRules* const stream = rules_.stream_of_folder(whole);
    return is_note_path(whole) || token_of_path(whole) || (stream != nullptr && stream->has_name(whole));
  }

  /// A token that comes after the recording is stored before its entry is written, and the checkpoint over
  /// that comes last, too: a power cut can come between. A token is one if it is over the checkpoint it is
  /// named after, which may be an early one: an answer may come late.
  NameJudgement judge_after_close(std::string_view path) const {
    const bool part = path.ends_with(kPartSuffix);
    if (part) {
      path.remove_suffix(kPartSuffix.size());
    }
    const std::optional<TokenName> token = token_of_path(path);
    if (part) {
      return token || is_note_path(path) ? NameJudgement::kPart : NameJudgement::kUnnamed;
    }
    return token && is_token(*token) ? NameJudgement::kTokenNotEntered : NameJudgement::kUnnamed;
  }

  /// One that cannot be read is a file that nothing names.
  [[nodiscard]] bool is_token(const TokenName& name) const {
    try {
      return token_in_folder(folder_, name).has_value();
    } catch (const Error&) {
      return false;
    }
  }

  /// Finished segments whose entries are not written yet: those that follow a stream's last entered one
  /// without a hole. Several may wait for a slow disk.
  void find_not_entered() {
    if (rules_.close_entry()) {
      return;
    }
    std::set<std::string_view> regular;
    for (const ListedFile& file : listing_) {
      if (file.kind == ListedFile::Kind::kRegular) {
        regular.insert(file.path);
      }
    }
    for (const auto& [name, stream] : rules_.streams()) {
      bool follows = true;
      for (std::uint64_t further = 0; follows; ++further) {
        follows = false;
        for (const std::string& file : stream.next_files(further)) {
          if (follows || !regular.contains(file)) continue;
          not_entered_.insert(file);
          follows = true;
        }
      }
    }
  }

  void judge_names() {
    find_not_entered();
    left_ = check_folder_names(listing_, findings_, [&](const ListedFile& file) { return judge_name(file); });
    for (const ListedFile& file : listing_) {
      if (file.kind == ListedFile::Kind::kRegular && rules_.erased(file.path)) {
        findings_.add("erased-file-present", {file.path},
                      file.path + " is still there, although it was erased by policy");
      }
    }
    if (!rules_.opening()) return;
    const std::string name = folder_name(folder_.path());
    const std::string& case_id = rules_.opening()->case_id;
    if (name == case_id) return;
    if (is_case_id(name)) {
      findings_.add("folder-of-another-case", {},
                    "the folder is called by the identifier of case " + name +
                        ", and what lies in it is case " + case_id + ": nothing here is of " + name);
    } else {
      findings_.add("folder-name-differs", {}, "the folder is not called " + case_id);
    }
  }

  VerificationReport report() {
    VerificationReport report;
    rules_.describe(report);
    report.entries = tree_.size();
    report.lines_root = tree_.root();
    report.checkpoints = checkpoints_.count();
    report.signatures = checkpoints_.signatures_checked();
    report.signed_entries = checkpoints_.signed_entries();
    report.newest_note = checkpoints_.newest_fitting();
    report.in_log = in_log_;
    report.close_entry = rules_.close_entry();
    report.proved_entries = log_proof_.entries_proved();
    report.files = files_.files() + report.tokens + report.checkpoints + kFilesOfACase;
    report.bytes = bytes_in(listing_) - left_.bytes;
    report.left_by_systems = left_.files;
    report.contents = files_.contents();
    if (also_ != nullptr) also_->taken = files_.further_hashes();
    report.brackets = rules_.tokens().brackets(0, tree_.size());
    report.clocks = rules_.tokens().clocks();
    take_log_findings(by_log_, options_, findings_);
    if (findings_.worst() != Severity::kTampered) {
      const TokenRules& tokens = rules_.tokens();
      check_case_evidence(
          folder_,
          {report.case_id, tree_.size(), tree_.root(), tokens.signatures(), tokens.valid(), tokens.outside()},
          files_.further_hashes(), options_, findings_, report);
    }
    if (rules_.opening() && rules_.device() && !rules_.gave_up() && !findings_.has("entry-too-long")) {
      check_store_statements(folder_, {report.case_id, *rules_.device(), tree_.size()}, options_, findings_);
    }
    report.witnesses = judge_case_witnesses(options_, walked_log_, log_proof_);
    report.verdict = verdict_of(findings_.worst());
    report.findings = findings_.take();
    return report;
  }

  const CaseFolder& folder_;
  const VerifyOptions& options_;
  AlsoHash* const also_;  // may be null
  FindingList findings_, by_log_;
  std::vector<ListedFile> listing_;
  std::set<std::string> not_entered_;
  LeftBySystems left_;
  CheckpointRules checkpoints_;
  EventMarks marks_;
  FileChecker files_;
  CaseRules rules_;
  VerifyOptions options_of_case_;  // without the notes of logs
  OutsideNotes outside_;
  LogProof log_proof_;
  std::optional<WalkedLog> walked_log_;
  EntriesBy vouched_by_log_;  // entries whose root the log states under a signature by that key
  std::optional<CaseInLog> in_log_;
  crypto::MerkleFrontier tree_;
};

/// Whether cases are to be looked for beside the log: it lies where an archive keeps it.
bool is_archive(const std::filesystem::path& folder) {
  std::error_code error;
  for (const auto& each : std::filesystem::directory_iterator(folder, error)) {
    if (is_case_id(each.path().filename().string()) || each.path().filename() == ".reserve") {
      return true;
    }
  }
  return false;
}

/// What lies where a case should be.
struct LyingThere {
  bool unreadable = false;                           // so it may be any case
  std::optional<crypto::Sha256Digest> opening_line;  // of a ledger that begins with a whole line

  [[nodiscard]] bool may_be(const crypto::Sha256Digest& line) const {
    return unreadable || opening_line == line;
  }
};
/// An excerpt in a case's place is not it, and neither is another case or an empty ledger.
LyingThere look_at(const std::filesystem::path& folder) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) {
    return {};
  }
  try {
    const FileOpening ledger = CaseFolder::open(folder).open_file(kLedgerFile);
    if (!ledger.file) {
      return {ledger.problem != FileProblem::kMissing, {}};
    }
    const std::optional<std::string> line = first_whole_line(*ledger.file);
    return {false, line ? std::optional(crypto::sha256(bytes_of(*line))) : std::nullopt};
  } catch (const IoError&) {
    return {true, {}};
  }
}

std::string what_lies_instead(const std::filesystem::path& folder) {
  if (is_excerpt(folder)) {
    return ": an excerpt lies in its place";
  }
  std::error_code error;
  return std::filesystem::exists(folder / kLedgerFile, error) ? ": what lies in its place begins otherwise"
                                                              : "";
}

/// Of a case that the log opened, or tells of, in `entry` and that is not in the archive.
void report_missing(const std::string& case_id, std::string_view deed, std::uint64_t entry, bool vouched,
                    bool accuses, const std::filesystem::path& archive, FindingList& findings) {
  const Place place{std::string(kLedgerFile), entry};
  const std::string text = "case " + case_id + " was " + std::string(deed) + " (entry " +
                           std::to_string(entry) + " of the log), was not erased, and is not in " +
                           archive.string() + what_lies_instead(archive / case_id);
  if (vouched && !accuses) {
    findings.add("log-of-another-device", place,
                 text +
                     "; the log was another device's then, which is not trusted and did not begin it: "
                     "whoever has a copy of a log can carry it on so");
  } else if (vouched) {
    findings.add("case-missing", place, text);
  } else {
    findings.add("log-entry-doubted", place,
                 text +
                     "; what the log says of it has no checkpoint of its own: it was never signed, or "
                     "its checkpoint was removed. Whoever could write to the disk could have made it");
  }
}

void look_for_cases(const LogContents& log, const std::filesystem::path& log_folder, FindingList& findings) {
  const std::filesystem::path absolute = std::filesystem::absolute(log_folder).lexically_normal();
  const std::filesystem::path normal = absolute.has_filename() ? absolute : absolute.parent_path();
  const std::filesystem::path archive = normal.parent_path();
  const bool search = normal.filename() == "log" && is_archive(archive);
  std::uint64_t not_looked_for = 0;
  for (const auto& [case_id, logged] : log.cases) {
    if (!logged.opened) {
      // Its opening could not be entered, on a full disk say; the log knows it all the same.
      const LyingThere there = search && logged.told ? look_at(archive / case_id) : LyingThere{true, {}};
      if (!logged.erased && !there.unreadable && !there.opening_line) {
        report_missing(case_id, "recorded", *logged.told, logged.vouched, logged.accuses, archive, findings);
      }
      continue;
    }
    const Place opened{std::string(kLedgerFile), logged.opened};
    not_looked_for += search || logged.erased ? 0 : 1 + logged.further.size();
    const LyingThere there = search ? look_at(archive / case_id) : LyingThere{};
    if (search && !logged.erased && !there.may_be(logged.opening_line)) {
      report_missing(case_id, "opened", *logged.opened, logged.vouched, logged.accuses, archive, findings);
    } else if (!logged.closed && !logged.erased) {
      findings.add("log-case-open", opened, "the log knows no end of case " + case_id);
    }
    if (search && !logged.erased) {
      // Of several cases under one identifier one alone can be there.
      for (const FurtherOpening& each : logged.further) {
        if (!there.may_be(each.opening_line)) {
          report_missing(case_id, "opened", each.entry, each.vouched, logged.accuses, archive, findings);
        }
      }
    }
    if (logged.erased && there.opening_line == logged.opening_line) {
      findings.add(
          "log-case-erased", opened,
          "the log says that the whole case " + case_id + " was erased, and it is in " + archive.string());
    }
  }
  if (not_looked_for > 0) {
    findings.add("cases-not-looked-for", {std::string(kLedgerFile)},
                 "no case of an archive lies beside this log, so whether the " +
                     std::to_string(not_looked_for) + (not_looked_for == 1 ? " case" : " cases") +
                     " that it knows are still there was not checked");
  }
}

}  // namespace

std::int64_t AuthorityClock::drift_ns() const {
  const auto elapsed = std::chrono::duration_cast<std::chrono::nanoseconds>(last.gen_time - first.gen_time);
  return elapsed.count() - (last.case_ns - first.case_ns);
}

std::int64_t offset_ns(const ClockComparison& comparison, UtcTime clock_zero) {
  const auto since_zero =
      std::chrono::duration_cast<std::chrono::nanoseconds>(comparison.gen_time - clock_zero);
  return since_zero.count() - comparison.case_ns;
}

namespace {

std::optional<std::uint64_t> ledger_bytes(const CaseFolder& folder) {
  const FileOpening ledger = folder.open_file(kLedgerFile);
  return ledger.file ? std::optional(ledger.file->size()) : std::nullopt;
}

/// Whether a recorder that goes on while a case is read can be the reason: the folder was listed before the
/// ledger was read, and files are looked for after it.
bool may_be_of_a_change(const VerificationReport& report) {
  constexpr std::array<std::string_view, 4> kCodes{"checkpoint-missing", "ledger-not-covered", "file-missing",
                                                   "file-unnamed"};
  return std::ranges::any_of(report.findings, [&](const Finding& finding) {
    return std::ranges::find(kCodes, finding.code) != kCodes.end();
  });
}

/// One run, and whether its ledger grew meanwhile.
std::pair<VerificationReport, bool> verify_once(const std::filesystem::path& folder,
                                                const VerifyOptions& options, AlsoHash* also) {
  const CaseFolder opened =
      CaseFolder::open(folder, options.files == nullptr ? real_reading() : *options.files);
  if (is_excerpt(opened)) {
    return {verify_excerpt(opened, options), false};
  }
  const FileOpening ledger = opened.open_file(kLedgerFile);
  if (!ledger.file && ledger.problem == FileProblem::kMissing) {
    throw UsageError(folder.string() + " is no case: there is no " + std::string(kLedgerFile) +
                     " in it; give the folder of a case");
  }
  if (!ledger.file && ledger.problem == FileProblem::kUnreadable) {
    throw Error("cannot verify " + folder.string() + ": its " + std::string(kLedgerFile) + " " +
                ledger.explanation);
  }
  if (ledger.file) {
    if (auto newer = report_on_newer_case(opened, *ledger.file, options)) {
      return {std::move(*newer), false};
    }
  }
  VerificationReport report = CaseVerification(opened, options, also).run();
  const bool grew = ledger.file && ledger_bytes(opened) != ledger.file->size();
  return {std::move(report), grew};
}

// Whoever writes to the ledger all the time makes this take three times as long, and no longer.
VerificationReport verify_settled(const std::filesystem::path& folder, const VerifyOptions& options,
                                  AlsoHash* also) {
  constexpr int kMostRuns = 3;
  for (int run = 1;; ++run) {
    auto [report, grew] = verify_once(folder, options, also);
    if (!grew || run == kMostRuns || !may_be_of_a_change(report)) {
      return std::move(report);
    }
  }
}

}  // namespace

VerificationReport verify_case(const std::filesystem::path& folder, const VerifyOptions& options) {
  return verify_settled(folder, options, nullptr);
}

VerificationReport verify_case(const std::filesystem::path& folder, const VerifyOptions& options,
                               AlsoHash& also) {
  return verify_settled(folder, options, &also);
}

VerificationReport verify_log(const std::filesystem::path& folder, const VerifyOptions& options) {
  FindingList findings;
  OutsideNotes outside(options, findings);
  VerificationReport report;
  report.case_id = "log";
  try {
    const CaseFolder opened =
        CaseFolder::open(folder, options.files == nullptr ? real_reading() : *options.files);
    LogWalk walk(opened, options, findings, {});
    walk.compare_with(outside);
    const LogContents log = walk.run();
    if (!log.gave_up) {
      look_for_cases(log, folder, findings);
    }
    if (!log.gave_up && log.told_by_another) {
      findings.add("log-of-another-device", {std::string(kLedgerFile), log.told_by_another},
                   "the log was another device's when it tells in its entry " +
                       std::to_string(*log.told_by_another) +
                       " of a case that its own device entered before: what stands there counts neither for "
                       "that case nor against it");
    }
    check_without_evidence("an appliance log", options, {}, findings);
    report.device = log.device;
    report.entries = log.entries;
    report.checkpoints = log.checkpoints;
    report.signatures = log.signatures;
    report.signed_entries = log.signed_entries;
    report.files = log.checkpoints + 1;
    const std::uint64_t all_bytes = bytes_in(opened.list());  // listed anew: it may have grown, or shrunk
    report.bytes = all_bytes - std::min(all_bytes, log.left.bytes);
    report.left_by_systems = log.left.files;
    report.opened = log.begins;
  } catch (const Error& error) {
    // Two notes that contradict each other prove a fork also where the log is gone.
    if (!outside.contradict_each_other()) {
      throw;
    }
    outside.finish(0, false);
    findings.add("file-unreadable", {std::string(kLedgerFile)}, error.what());
  }
  report.verdict = verdict_of(findings.worst());
  report.findings = findings.take();
  return report;
}

}  // namespace kiroku::archive
