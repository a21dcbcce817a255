#include "archive/excerpt_verifier.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "archive/age_layout.h"
#include "archive/case_layout.h"
#include "archive/case_rules.h"
#include "archive/excerpt_document.h"
#include "archive/folder_names.h"
#include "archive/log_rules.h"
#include "archive/verdict.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

using crypto::Sha256Digest;

/// One run over one excerpt folder.
class ExcerptVerification {
 public:
  ExcerptVerification(const CaseFolder& folder, const VerifyOptions& options, ExcerptDocument document)
      : folder_(folder),
        options_(options),
        document_(std::move(document)),
        listing_(folder.list()),
        present_(paths_of(listing_)),
        checkpoints_(folder, options, findings_, note_sizes(listing_)),
        files_(folder, options, findings_, bytes_in(listing_)),
        rules_(folder, options, findings_, checkpoints_, files_,
               {false, [this](const SegmentEntry& segment) { return must_be_checked(segment); },
                [this](const std::string& file) {
                  return present_.contains(file + std::string(kOriginalHeaderSuffix));
                }}) {}

  VerificationReport run() {
    std::optional<ReadableFile> open_file = open(kExcerptOpenFile);
    std::optional<ReadableFile> lines_file = open(kExcerptLinesFile);
    if (open_file && lines_file) {
      walk(*open_file, *lines_file);
    }
    rules_.judge_missing(files_.finish());
    check_folder_names(listing_, findings_, [&](const ListedFile& file) { return judge_name(file); });
    rules_.check_device_file();
    return report();
  }

 private:
  static std::set<std::string> paths_of(const std::vector<ListedFile>& listing) {
    std::set<std::string> paths;
    for (const ListedFile& file : listing) {
      paths.insert(file.path);
    }
    return paths;
  }

  std::optional<ReadableFile> open(std::string_view file) {
    FileOpening opening = folder_.open_file(file);
    if (!opening.file) {
      report_unopened(findings_, {std::string(file)}, opening);
    }
    return std::move(opening.file);
  }

  bool selected(const SegmentEntry& segment) const {
    return std::find(document_.streams.begin(), document_.streams.end(), segment.stream) !=
               document_.streams.end() &&
           meets(segment.span, document_.from_ns, document_.to_ns);
  }
  /// What the excerpt says it holds, and whatever else of the case lies there.
  bool must_be_checked(const SegmentEntry& segment) const {
    return selected(segment) || present_.contains(segment.file.file);
  }

  void walk(const ReadableFile& open_file, const ReadableFile& lines_file) {
    LineReader open_reader(open_file);
    LedgerLine line;
    if (!open_reader.next(line) || line.torn) {
      malformed(kExcerptOpenFile, "it does not hold one whole line");
      return;
    }
    const std::string open_line(line.text);
    const Sha256Digest open_leaf = crypto::merkle_leaf_hash(bytes_of(open_line));
    const Sha256Digest open_hash = crypto::sha256(bytes_of(open_line));
    judged_.append(open_leaf);
    LedgerLine more;
    if (open_reader.next(more)) {
      malformed(kExcerptOpenFile, "it holds more than one line");
    }
    line.text = open_line;
    read_signed_root();
    if (document_.first_entry > 0) {
      rules_.take(line, 0);
      check_opening(open_leaf);
    }
    // Notes from before the lines come first: only a consistency proof can tie them to the tree.
    bool earlier_done = document_.first_entry == 0;
    LineReader reader(lines_file);
    std::uint64_t number = document_.first_entry;
    std::optional<LogContents> log;
    std::optional<LogComparison> comparison;
    while (reader.next(line) && !line.torn) {
      if (number == 0 && line.text != open_line) {
        malformed(kExcerptOpenFile, "it is not the first line of " + std::string(kExcerptLinesFile));
      }
      leaves_.push_back(crypto::merkle_leaf_hash(bytes_of(line.text)));
      judged_.append(leaves_.back());
      if (!earlier_done) {
        check_earlier();
        earlier_done = true;
      }
      rules_.take(line, number);
      if (number == document_.first_entry) {
        log = walk_log();
        comparison.emplace(log ? &*log : nullptr, rules_.opening(), findings_);
        comparison->check_opening(open_hash);
      }
      ++number;
      const auto fits = [&](const Sha256Digest& root) {
        return crypto::verify_range(leaves_, document_.first_entry, number, document_.left, root);
      };
      checkpoints_.reached(number, fits, !line.too_long, rules_.last_mono_ns());
      if (comparison->asks_for(number)) {
        comparison->reached(number, fits);
      }
    }
    if (line.torn && line.bytes > 0) {
      malformed(kExcerptLinesFile, "its last line is not whole");
    }
    if (number != document_.size) {
      malformed(kExcerptLinesFile, "it ends with entry " + std::to_string(number) + " where " +
                                       std::string(kExcerptFile) + " states a size of " +
                                       std::to_string(document_.size));
    }
    if (!checkpoints_.has(document_.size)) {
      findings_.add("checkpoint-missing", {note_path(document_.size)},
                    note_path(document_.size) + " is not there, which must cover all lines of the excerpt");
    }
    checkpoints_.finish(number);
    rules_.finish();
    judge_reach();
  }

  std::optional<LogContents> walk_log() {
    if (!options_.log || !rules_.opening()) {
      return std::nullopt;
    }
    const CaseFolder folder = CaseFolder::open(*options_.log);
    FindingList of_log;
    LogWalk walk(folder, options_, of_log, rules_.opening()->case_id, rules_.opening()->appliance_log_size);
    LogContents contents = walk.run();
    findings_.take_from(of_log, "log");
    return contents;
  }

  void malformed(std::string_view file, const std::string& what) {
    findings_.add("excerpt-malformed", {std::string(file)}, std::string(file) + ": " + what);
  }

  /// The root that the covering note states. Whether the note is signed is checked with all others.
  void read_signed_root() {
    if (!checkpoints_.has(document_.size)) {
      return;
    }
    FindingList said_later;
    if (const auto note = read_note(folder_, document_.size, std::nullopt, said_later)) {
      if (const auto checkpoint = crypto::Checkpoint::parse(crypto::open_note(*note, {}).text)) {
        signed_root_ = checkpoint->root;
      }
    }
  }

  void check_opening(const Sha256Digest& open_leaf) {
    if (signed_root_ &&
        !crypto::verify_inclusion(open_leaf, 0, document_.size, document_.open_proof, *signed_root_)) {
      findings_.add("excerpt-proof-invalid", {std::string(kExcerptOpenFile), 0},
                    std::string(kExcerptOpenFile) + " is not proven to be entry 0 of the signed tree");
    }
  }

  void check_earlier() {
    for (const std::uint64_t size : note_sizes(listing_)) {
      if (size > document_.first_entry) {
        break;
      }
      const auto proof =
          std::find_if(document_.earlier.begin(), document_.earlier.end(),
                       [&](const ExcerptDocument::Earlier& each) { return each.size == size; });
      const auto fits = [&](const Sha256Digest& root) {
        const bool proven =
            proof != document_.earlier.end() && signed_root_ &&
            crypto::verify_consistency(size, root, document_.size, *signed_root_, proof->proof);
        if (!proven) {
          findings_.add("excerpt-proof-invalid", {note_path(size)},
                        note_path(size) + " is not proven to be of the same tree as the later checkpoints");
        }
        return true;  // said
      };
      checkpoints_.reached(size, fits, true, std::nullopt);
    }
  }

  void judge_reach() {
    for (const std::string& name : document_.streams) {
      const auto stream = rules_.streams().find(name);
      if (stream == rules_.streams().end()) {
        malformed(kExcerptFile, "it selects a stream \"" + name + "\" that the case does not have");
      } else if (!stream->second.reaches_over(document_.from_ns, document_.to_ns,
                                              rules_.close_entry().has_value())) {
        findings_.add("excerpt-range-short", {std::string(kExcerptLinesFile)},
                      "the lines do not show " + name + " over the whole time that the excerpt states");
      }
    }
    if (rules_.opening() && document_.case_id != rules_.opening()->case_id) {
      malformed(kExcerptFile,
                "it names the case " + document_.case_id + ", its lines " + rules_.opening()->case_id);
    }
    if (rules_.tokens().count() > 0 && rules_.tokens().largest_checkpoint() <= last_selected()) {
      findings_.add(
          "excerpt-no-later-token", {std::string(kExcerptLinesFile), last_selected()},
          "no token covers the excerpt's last segment, in entry " + std::to_string(last_selected()));
    }
  }

  std::uint64_t last_selected() const { return rules_.last_checked_segment().value_or(0); }

  NameJudgement judge_name(const ListedFile& file) const {
    const std::string& path = file.path;
    for (const std::string_view known : {kExcerptFile, kExcerptOpenFile, kExcerptLinesFile, kDeviceFile}) {
      if (path == known) {
        return NameJudgement::kNamed;
      }
    }
    if (path == kSubjectFile) {
      return NameJudgement::kUnnamed;  // named by open, but an excerpt holds no patient's data
    }
    if (rules_.names(path) || is_note_path(path)) {
      return NameJudgement::kNamed;
    }
    if (path.ends_with(kOriginalHeaderSuffix) &&
        rules_.names(path.substr(0, path.size() - kOriginalHeaderSuffix.size()))) {
      return NameJudgement::kNamed;
    }
    if (path.starts_with(std::string(kAuthoritiesFolder) + "/")) {
      return NameJudgement::kFree;
    }
    return file.kind == ListedFile::Kind::kFolder && rules_.is_folder(path) ? NameJudgement::kNamed
                                                                            : NameJudgement::kUnnamed;
  }

  VerificationReport report() {
    VerificationReport report;
    rules_.describe(report);
    report.entries = leaves_.size();
    if (judged_.size() > 0) {
      report.lines_root = judged_.root();
    }
    report.checkpoints = checkpoints_.count();
    report.files = files_.files() + report.tokens + report.checkpoints + 3;
    report.bytes = bytes_in(listing_);
    report.brackets = rules_.tokens().brackets(
        document_.first_entry, document_.first_entry + std::max<std::uint64_t>(1, leaves_.size()));
    report.verdict = verdict_of(findings_.worst());
    report.findings = findings_.take();
    return report;
  }

  const CaseFolder& folder_;
  const VerifyOptions& options_;
  ExcerptDocument document_;
  FindingList findings_;
  std::vector<ListedFile> listing_;
  std::set<std::string> present_;
  CheckpointRules checkpoints_;
  FileChecker files_;
  CaseRules rules_;
  std::vector<Sha256Digest> leaves_;
  crypto::MerkleFrontier judged_;  // the opening line, then the lines
  std::optional<Sha256Digest> signed_root_;
};

}  // namespace

bool is_excerpt(const CaseFolder& folder) {
  return folder.open_file(kExcerptFile).file &&
         folder.open_file(kLedgerFile).problem == FileProblem::kMissing &&
         !folder.open_file(kLedgerFile).file;
}

VerificationReport verify_excerpt(const CaseFolder& folder, const VerifyOptions& options) {
  const FileOpening opening = folder.open_file(kExcerptFile);
  const std::optional<std::string> text =
      opening.file ? read_small(*opening.file, kMaximumExcerptBytes) : std::nullopt;
  ExcerptParse parse = text ? parse_excerpt(*text) : ExcerptParse{std::nullopt, "it is far too long"};
  if (!parse.document) {
    VerificationReport report;
    const FindingCode& code = CodeName("excerpt-malformed").code();
    report.findings.push_back({std::string(code.name),
                               code.severity,
                               std::string(kExcerptFile),
                               {},
                               {},
                               std::string(kExcerptFile) + " cannot be read: " + parse.problem});
    report.verdict = Verdict::kTampered;
    return report;
  }
  return ExcerptVerification(folder, options, std::move(*parse.document)).run();
}

}  // namespace kiroku::archive
