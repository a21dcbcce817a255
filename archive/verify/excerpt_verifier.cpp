#include "archive/verify/excerpt_verifier.h"

#include <algorithm>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "archive/format/age_layout.h"
#include "archive/format/case_layout.h"
#include "archive/format/excerpt_document.h"
#include "archive/verify/authority_files.h"
#include "archive/verify/case_evidence.h"
#include "archive/verify/case_rules.h"
#include "archive/verify/case_witnesses.h"
#include "archive/verify/event_marks.h"
#include "archive/verify/folder_names.h"
#include "archive/verify/log_beside.h"
#include "archive/verify/log_rules.h"
#include "archive/verify/newer_format.h"
#include "archive/verify/outside_notes.h"
#include "archive/verify/verdict.h"
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
        checkpoints_(folder, options, findings_, note_sizes(listing_), are_notes_listed(listing_)),
        files_(folder, options, findings_, bytes_in(listing_)),
        rules_(folder, options, findings_, checkpoints_, files_,
               {false, document_.first_entry <= 1, document_.first_entry,
                [this](const SegmentEntry& segment) { return select(segment); },
                [this](const std::string& file) {
                  return present_.contains(file + std::string(kOriginalHeaderSuffix));
                }}),
        options_of_case_(with_notes_of_logs(options, false)),
        outside_(options.log ? options_of_case_ : options, findings_),
        log_proof_(options, by_log_),
        selected_streams_(document_.streams.begin(), document_.streams.end()),
        tree_(crypto::MerkleFrontier::after(document_.first_entry, document_.left)) {
    if (options.identities == nullptr) return;
    files_.compare_events(marks_);
    rules_.compare_events(marks_);
  }

  VerificationReport run() {
    std::optional<ReadableFile> open_file = open(kExcerptOpenFile);
    std::optional<ReadableFile> lines_file = open(kExcerptLinesFile);
    if (open_file && lines_file) {
      files_.also_hash(further_hashes_of_excerpt(folder_, document_.case_id, options_));
      walk(*open_file, *lines_file);
    }
    if (rules_.opening() && rules_.device()) {
      outside_.add_shown(case_origin(rules_.device()->name(), rules_.opening()->case_id), *rules_.device());
    }
    outside_.finish(document_.first_entry + lines_, false);
    log_proof_.finish_part({rules_.opening() ? rules_.opening()->case_id : std::string(), rules_.device()},
                           document_.size, shown_root_);
    checkpoints_.judge_keys(document_.size, log_proof_.vouched_by(vouched_by_log_));
    const std::vector<MissingFile> missing = files_.finish();
    if (!rules_.gave_up()) {
      rules_.judge_missing(missing);
      compare_events();
    }
    // Without the lines nothing says what is named.
    if (!rules_.gave_up() && !lines_unread_) {
      left_ =
          check_folder_names(listing_, findings_, [&](const ListedFile& file) { return judge_name(file); });
    }
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

  void compare_events() {
    const bool leaves_lines_out = document_.first_entry > 1;
    marks_.finish({.is_whole = false,
                   .begins_ns = leaves_lines_out ? std::optional(lines_begin_ns_) : std::nullopt,
                   .stretch = Span{document_.from_ns, document_.to_ns}},
                  findings_);
  }

  std::optional<ReadableFile> open(std::string_view file) {
    FileOpening opening = folder_.open_file(file);
    if (!opening.file) {
      report_unopened(findings_, {std::string(file)}, opening);
      lines_unread_ = lines_unread_ || opening.problem == FileProblem::kUnreadable;
    }
    return std::move(opening.file);
  }

  bool selects(const std::string& stream) const { return selected_streams_.contains(stream); }
  /// Whether the excerpt must hold the segment; one that it need not hold it may not hold either.
  bool select(const SegmentEntry& segment) {
    if (!selects(segment.stream) || !meets(segment.span, document_.from_ns, document_.to_ns)) {
      return false;
    }
    if (segment.file.file.size() <= kMaximumPathBytes) {
      selected_files_.insert(segment.file.file);
      selected_segments_.push_back({segment.file.file, 0, segment.file});
    }
    return true;
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
    LogBeside log;
    std::optional<LogComparison> comparison;
    while (!rules_.gave_up() && reader.next(line) && !line.torn) {
      if (number == 0 && line.text != open_line) {
        malformed(kExcerptOpenFile, "it is not the first line of " + std::string(kExcerptLinesFile));
      }
      ++lines_;
      const Sha256Digest leaf = crypto::merkle_leaf_hash(bytes_of(line.text));
      judged_.append(leaf);
      if (tree_) {
        tree_->append(leaf);
      }
      if (!earlier_done) {
        check_earlier();
        earlier_done = true;
      }
      rules_.take(line, number);
      if (number == document_.first_entry) {
        lines_begin_ns_ = rules_.last_mono_ns();
        if (rules_.opening()) {
          log = read_log_beside(options_, rules_.opening(), by_log_);
          walked_log_ = log.walked;
        }
        comparison.emplace(log.contents ? &*log.contents : nullptr, rules_.opening(), by_log_);
        comparison->check_opening(open_hash);
      }
      ++number;
      const auto fits = [&](const Sha256Digest& root) { return tree_ && tree_->root() == root; };
      checkpoints_.reached(number, fits, !line.too_long, rules_.last_mono_ns());
      outside_.reached(number, fits, !line.too_long);
      if (comparison->asks_for(number)) {
        comparison->reached(number, fits);
      }
    }
    if (rules_.gave_up()) {
      return;
    }
    if (line.torn && line.bytes > 0) {
      malformed(kExcerptLinesFile, "its last line is not whole");
    }
    if (number != document_.size) {
      malformed(kExcerptLinesFile, "it ends with entry " + std::to_string(number) + " where " +
                                       std::string(kExcerptFile) + " states a size of " +
                                       std::to_string(document_.size));
    }
    if (!checkpoints_.has(document_.size) && checkpoints_.all_listed()) {
      findings_.add("checkpoint-missing", {note_path(document_.size)},
                    note_path(document_.size) + " is not there, which must cover all lines of the excerpt");
    }
    // The note was read once for the proofs and once to be judged.
    if (signed_root_ && tree_ && number == document_.size && tree_->root() != *signed_root_) {
      findings_.add("excerpt-proof-invalid", {note_path(document_.size)},
                    "the root that the proofs lead to is not that of the lines");
    }
    if (tree_ && number == document_.size) {
      shown_root_ = tree_->root();
    }
    checkpoints_.finish(number);
    rules_.finish(document_.first_entry > 1 ? std::optional(lines_begin_ns_) : std::nullopt);
    if (comparison) {
      comparison->settle(checkpoints_.covered(), std::nullopt);
      vouched_by_log_ = comparison->vouched_by();
      in_log_ = comparison->told();
    }
    judge_reach();
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
    std::unordered_map<std::uint64_t, const ExcerptDocument::Earlier*> proofs;
    for (const ExcerptDocument::Earlier& each : document_.earlier) {
      proofs.emplace(each.size, &each);
    }
    for (const std::uint64_t size : note_sizes(listing_)) {
      if (size > document_.first_entry) {
        break;
      }
      const auto proof = proofs.find(size);
      const auto fits = [&](const Sha256Digest& root) {
        const bool proven =
            proof != proofs.end() && signed_root_ &&
            crypto::verify_consistency(size, root, document_.size, *signed_root_, proof->second->proof);
        if (!proven) {
          findings_.add("excerpt-proof-invalid", {note_path(size)},
                        note_path(size) + " is not proven to be of the same tree as the later checkpoints");
        }
        return proven;
      };
      checkpoints_.reached(size, fits, true, std::nullopt, true);
    }
  }

  /// Latest time of the case clock that the lines tell of.
  std::int64_t last_moment() const {
    std::int64_t last = rules_.last_mono_ns();
    for (const auto& [name, stream] : rules_.streams()) {
      last = std::max(last, stream.report().span.end_ns);
    }
    return last;
  }

  std::optional<StreamTotal> total_of(const std::string& stream) const {
    const auto total = rules_.close_totals().find(stream);
    return total == rules_.close_totals().end() ? std::nullopt : std::optional(total->second);
  }

  /// Whether the excerpt is of something that the case has, and of all of it.
  void judge_reach() {
    if (rules_.opening() &&
        (document_.from_ns < rules_.opening()->begins_ns || document_.from_ns >= last_moment())) {
      findings_.add("excerpt-outside-case", {std::string(kExcerptFile)},
                    std::string(kExcerptFile) + " states a time from " + std::to_string(document_.from_ns) +
                        " ns on, where the case begins at " + std::to_string(rules_.opening()->begins_ns) +
                        " ns and the lines go to " + std::to_string(last_moment()) + " ns");
    }
    const bool nothing = std::all_of(selected_files_.begin(), selected_files_.end(),
                                     [this](const std::string& file) { return rules_.erased(file); });
    if (nothing) {
      findings_.add("excerpt-empty", {std::string(kExcerptFile)},
                    "no segment of the streams that " + std::string(kExcerptFile) +
                        " names lies in the time that it states: it is an excerpt of nothing");
    }
    for (const std::string& name : document_.streams) {
      const auto stream = rules_.streams().find(name);
      const std::optional<StreamTotal> total = total_of(name);
      const StreamRules::LinesShown lines{lines_begin_ns_, rules_.recorded_from_ns(), rules_.closed_ns(),
                                          total ? std::optional(total->segments) : std::nullopt};
      if (stream == rules_.streams().end()) {
        malformed(kExcerptFile, "it selects a stream \"" + name + "\" that the case does not have");
      } else if (!stream->second.shows_all_of(document_.from_ns, document_.to_ns, lines)) {
        findings_.add(
            "excerpt-range-short", {std::string(kExcerptLinesFile)},
            "the lines do not show every segment that " + name + " has in the time that the excerpt states");
      } else {
        stream->second.check_stated_time({document_.from_ns, document_.to_ns}, lines);
      }
    }
    rules_.judge_pre_roll(document_.from_ns);
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

  NameJudgement judge_name(const ListedFile& file) {
    const std::string& path = file.path;
    for (const std::string_view known : {kExcerptFile, kExcerptOpenFile, kExcerptLinesFile, kDeviceFile}) {
      if (path == known) {
        return NameJudgement::kNamed;
      }
    }
    if (path == kSubjectFile) {
      return NameJudgement::kUnnamed;  // named by open, but an excerpt holds no patient's data
    }
    const bool segment = path.starts_with(std::string(kSegmentsFolder) + "/");
    if ((rules_.names(path) && !segment) || selected_files_.contains(path) || is_note_file(file)) {
      return NameJudgement::kNamed;
    }
    if (path.ends_with(kOriginalHeaderSuffix)) {
      // Beside a segment that is not here, nothing would look into it.
      const std::string its = path.substr(0, path.size() - kOriginalHeaderSuffix.size());
      return selected_files_.contains(its) && present_.contains(its) ? NameJudgement::kNamed
                                                                     : NameJudgement::kUnnamed;
    }
    if (is_below_authorities(path)) {
      return judge_authority_file(
          folder_, file, [this](const std::string& name) { return rules_.names_authority(name); }, findings_);
    }
    return file.kind == ListedFile::Kind::kFolder && rules_.is_folder(path) ? NameJudgement::kNamed
                                                                            : NameJudgement::kUnnamed;
  }

  VerificationReport report() {
    VerificationReport report;
    rules_.describe(report);
    describe_part(report);
    report.entries = lines_;
    if (judged_.size() > 0) {
      report.lines_root = judged_.root();
    }
    report.checkpoints = checkpoints_.count();
    report.signatures = checkpoints_.signatures_checked();
    report.signed_entries = checkpoints_.signed_entries();
    report.newest_note = checkpoints_.newest_fitting();
    report.in_log = in_log_;
    report.proved_entries = log_proof_.entries_proved();
    report.files = files_.files() + report.tokens + report.checkpoints + kFilesOfAnExcerpt;
    report.bytes = bytes_in(listing_) - left_.bytes;
    report.left_by_systems = left_.files;
    report.contents = files_.contents();
    report.rekeyed_segments = files_.rekeyed();
    report.rekeyed_opened = files_.rekeyed_opened();
    report.brackets = rules_.tokens().brackets(document_.first_entry,
                                               document_.first_entry + std::max<std::uint64_t>(1, lines_));
    take_log_findings(by_log_, options_, findings_);
    if (findings_.worst() != Severity::kTampered) {
      const TokenRules& tokens = rules_.tokens();
      check_excerpt_evidence(
          folder_, {report.case_id, lines_, {}, tokens.signatures(), tokens.valid(), tokens.outside()},
          shown_data(), files_.further_hashes(), options_, findings_, report);
    }
    report.witnesses = judge_case_witnesses(options_, walked_log_, log_proof_,
                                            ShownPart{document_.size, in_log_ ? in_log_->entries : 0});
    report.verdict = verdict_of_excerpt(findings_.worst());
    report.findings = findings_.take();
    return report;
  }

  /// What lies here as it lies in the case: a re-keyed segment does not.
  [[nodiscard]] ExcerptData shown_data() const {
    ExcerptData data{document_.size, {}, 0};
    for (const std::uint64_t size : note_sizes(listing_)) {
      if (size > 0 && size <= document_.size) data.files.push_back({note_path(size), size - 1, {}});
    }
    for (const ListedFile& file : listing_) {
      if (token_of_path(file.path)) data.files.push_back({file.path, document_.size - 1, {}});
    }
    for (const NamedFile& segment : selected_segments_) {
      if (!present_.contains(segment.file)) continue;
      if (present_.contains(segment.file + std::string(kOriginalHeaderSuffix)))
        ++data.resealed;
      else
        data.files.push_back(segment);
    }
    return data;
  }

  /// Puts what the folder holds in place of what the ledger names: the excerpt's lines tell of more.
  void describe_part(VerificationReport& report) const {
    ExcerptReport part;
    part.from_ns = document_.from_ns;
    part.to_ns = rules_.close_entry() ? std::min(document_.to_ns, last_moment()) : document_.to_ns;
    part.begins_ns = rules_.opening() ? rules_.opening()->begins_ns : 0;
    part.first_entry = document_.first_entry;
    part.size = document_.size;
    part.with_gaps = findings_.worst() == Severity::kGap;
    part.listed_segments = static_cast<std::uint64_t>(
        std::count_if(selected_files_.begin(), selected_files_.end(),
                      [this](const std::string& file) { return !rules_.erased(file); }));
    part.stated_made_at = document_.made_utc;
    part.stated_made_by = document_.made_by;
    std::vector<StreamReport> held_streams;
    for (const StreamReport& of_lines : report.streams) {
      const std::string& name = of_lines.info.name;
      const auto found = files_.held().find(name);
      const HeldSegments held = found == files_.held().end() ? HeldSegments{} : found->second;
      const std::optional<StreamTotal> total = total_of(name);
      part.streams.push_back({name, selects(name), held.segments, held.frames,
                              total ? std::optional(total->segments) : std::nullopt,
                              total ? std::optional(total->frames) : std::nullopt,
                              rules_.streams().at(name).known_segments()});
      if (selects(name)) {
        held_streams.push_back({of_lines.info, held.segments, held.frames, held.dropped, held.bytes,
                                held.span, rules_.streams().at(name).gap_within(part.from_ns, part.to_ns)});
      }
    }
    report.streams = std::move(held_streams);
    report.excerpt = std::move(part);
  }

  const CaseFolder& folder_;
  const VerifyOptions& options_;
  ExcerptDocument document_;
  FindingList findings_, by_log_;
  std::vector<ListedFile> listing_;
  LeftBySystems left_;
  std::set<std::string> present_;
  std::set<std::string> selected_files_;
  std::vector<NamedFile> selected_segments_;  // the same, with what their entries state
  bool lines_unread_ = false;                 // they are there, and nobody could read them
  std::int64_t lines_begin_ns_ = 0;
  CheckpointRules checkpoints_;
  EventMarks marks_;
  FileChecker files_;
  CaseRules rules_;
  VerifyOptions options_of_case_;  // without the notes of logs
  OutsideNotes outside_;
  LogProof log_proof_;
  EntriesBy vouched_by_log_;  // entries whose root the log states under a signature by that key
  std::optional<WalkedLog> walked_log_;
  std::optional<CaseInLog> in_log_;
  std::set<std::string> selected_streams_;
  // Over the lines until now and what lies before them; nothing where `left` is not of first_entry entries.
  std::optional<crypto::MerkleFrontier> tree_;
  std::uint64_t lines_ = 0;
  crypto::MerkleFrontier judged_;  // the opening line, then the lines
  std::optional<Sha256Digest> signed_root_;
  std::optional<Sha256Digest> shown_root_;  // of the case's first document_.size entries, by lines and proofs
};

}  // namespace

bool is_excerpt(const CaseFolder& folder) {
  if (!folder.open_file(kExcerptFile).file) {
    return false;
  }
  const FileOpening ledger = folder.open_file(kLedgerFile);
  return !ledger.file && ledger.problem == FileProblem::kMissing;
}

bool is_excerpt(const std::filesystem::path& folder, const FileReading& files) {
  try {
    return is_excerpt(CaseFolder::open(folder, files));
  } catch (const Error&) {
    return false;
  }
}

VerificationReport verify_excerpt(const CaseFolder& folder, const VerifyOptions& options) {
  const FileOpening opening = folder.open_file(kExcerptFile);
  const std::optional<std::string> text =
      opening.file ? read_small(*opening.file, kMaximumExcerptBytes) : std::nullopt;
  if (text) {
    if (auto newer = report_on_newer_excerpt(folder, *text, options)) {
      return std::move(*newer);
    }
  }
  ExcerptParse parse = text ? parse_excerpt(*text) : ExcerptParse{std::nullopt, "it is far too long"};
  if (!parse.document) {
    VerificationReport report;
    const FindingCode& code = kFindingCodes[CodeName("excerpt-malformed").index()];
    report.findings.push_back({std::string(code.name),
                               code.severity,
                               std::string(kExcerptFile),
                               {},
                               {},
                               std::string(kExcerptFile) + " is of no excerpt: " + parse.problem});
    report.verdict = Verdict::kTampered;
    return report;
  }
  return ExcerptVerification(folder, options, std::move(*parse.document)).run();
}

}  // namespace kiroku::archive
