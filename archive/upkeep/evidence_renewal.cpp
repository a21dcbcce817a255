#include "archive/upkeep/evidence_renewal.h"

#include <algorithm>
#include <cerrno>
#include <map>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/verify/case_evidence.h"
#include "archive/verify/hashing_verifier.h"
#include "archive/verify/record_choice.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;
using evidence::EvidenceRecord;
using What = EvidenceRenewal::What;

/// A case that is not at its end.
class StillOpen : public Error {
 public:
  using Error::Error;
};
/// No record of the case holds, or none is known to.
class NoneHolds : public Error {
 public:
  using Error::Error;
};
class Unread : public Error {
 public:
  Unread(const std::string& sentence, std::vector<std::string> of_files)
      : Error(sentence), files(std::move(of_files)) {}
  std::vector<std::string> files;
};

/// One case and what is to be done for it.
struct EvidenceWork {
  std::size_t answer = 0;            // its place among cases and results
  std::string file;                  // where the record lies, for sentences
  EvidenceRecord record;             // of a hash-tree renewal
  evidence::NewestTimeStamp newest;  // of a time-stamp renewal, which reads the record again:
  crypto::Sha256Digest chosen{};     // this one, as many cases may share that time-stamp
  evidence::HashList data;           // of a beginning and a hash-tree renewal
  bool outside = false;              // the record that is renewed rests on outside authorities alone
  std::optional<UtcTime> end;        // of the same
};

/// About what a value takes in memory.
constexpr std::size_t kBytesOfValue = 72;

/// A case in a folder, with its record in the folder of records beside it.
class CaseInFolder final : public RenewableCase {
 public:
  CaseInFolder(FileSystem& files, fs::path folder) : files_(files), folder_(std::move(folder)) {}
  [[nodiscard]] std::string name() const override { return folder_.filename().string(); }
  fs::path folder() override { return folder_; }
  const FileReading& files() override { return files_; }
  [[nodiscard]] std::string record_place(const std::string& case_id) const override {
    return evidence_file(folder_, case_id).string();
  }
  std::vector<Bytes> read_records(const std::string& case_id) override {
    std::optional<Bytes> record = read_evidence_file(files_, evidence_file(folder_, case_id));
    std::vector<Bytes> all;
    if (record) all.push_back(std::move(*record));
    return all;
  }
  void write_record(const std::string& case_id, ByteView record) override {
    const fs::path file = evidence_file(folder_, case_id);
    const fs::path folder = file.parent_path();
    if (!files_.is_folder(folder)) {
      files_.make_folder(folder);
      files_.sync_folder(folder.parent_path());
    }
    files_.write_durably(file, record);
  }

 private:
  FileSystem& files_;
  const fs::path folder_;
};

/// Under which files are hashed beside SHA-256.
void add_hash(std::vector<crypto::HashAlgorithm>& to, std::optional<crypto::HashAlgorithm> algorithm) {
  if (!algorithm || algorithm == crypto::HashAlgorithm::kSha256) return;
  if (std::ranges::find(to, *algorithm) == to.end()) to.push_back(*algorithm);
}

class EvidenceRenewer {
 public:
  EvidenceRenewer(const std::vector<std::unique_ptr<RenewableCase>>& cases,
                  const EvidenceRenewalOptions& options)
      : cases_(cases), options_(options) {}

  std::vector<EvidenceRenewal> run() {
    for (const std::unique_ptr<RenewableCase>& each : cases_) {
      results_.emplace_back().case_id = each->name();
      guard(results_.back(), [&] { look_at(*each); });
      try {
        each->let_go();
      } catch (const RenewalWaits& error) {
        drop(results_.size() - 1);
        EvidenceRenewal waits;
        waits.case_id = results_.back().case_id;
        waits.what = What::kWaits;
        waits.text = error.what();
        results_.back() = std::move(waits);
      }
      if (held_ >= options_.most_bytes) stamp_data();
    }
    if (options_.dry_run) return std::move(results_);
    stamp_data();
    stamp_newest();
    return std::move(results_);
  }

 private:
  template <typename Work>
  static void guard(EvidenceRenewal& result, const Work& work) {
    const auto tell = [&](What what, const Error& error) {
      result.what = what;
      result.text = error.what();
      result.before.reset();
      result.holds.reset();
    };
    try {
      work();
    } catch (const StillOpen& error) {
      tell(What::kStillOpen, error);
    } catch (const RenewalWaits& error) {
      const std::string due = result.text;
      tell(What::kWaits, error);
      result.text = (due.empty() ? "" : due + "; ") + error.what();
    } catch (const Unread& error) {
      tell(What::kRefused, error);
      result.unread = error.files;
    } catch (const Error& error) {
      tell(What::kRefused, error);
    }
  }

  [[nodiscard]] evidence::JudgingRules rules() const {
    return {.trust = options_.trust, .policy = &options_.policy, .now = options_.now()};
  }

  [[nodiscard]] RenewableCase& case_of(std::size_t answer) const { return *cases_[answer]; }

  /// Nothing that was to be done for the case is done.
  void drop(std::size_t answer) {
    for (std::vector<EvidenceWork>* works : {&begun_, &stamped_, &hashed_})
      std::erase_if(*works, [&](const EvidenceWork& work) { return work.answer == answer; });
  }

  /// The record that counts; nothing where there is none.
  std::optional<Bytes> read_record(RenewableCase& of, const CaseFolder& folder) {
    EvidenceRenewal& result = results_.back();
    std::vector<Bytes> records = of.read_records(result.case_id);
    if (records.empty()) return {};
    std::size_t chosen = 0;
    if (records.size() > 1) {
      const RecordChoice choice =
          choose_record(folder, records, rules(),
                        [&](const crypto::Sha256Digest& record) { return of.is_known_to_hold(record); });
      chosen = choice.index;
      if (choice.holds) result.holds = crypto::sha256(records[chosen]);
    } else if (const crypto::Sha256Digest hash = crypto::sha256(records.front()); of.is_known_to_hold(hash)) {
      result.holds = hash;
    }
    return std::move(records[chosen]);
  }

  void look_at(RenewableCase& of) {
    const CaseFolder opened = CaseFolder::open(of.folder(), of.files());
    EvidenceRenewal& result = results_.back();
    result.case_id = read_case_id(opened);
    EvidenceWork work;
    work.file = of.record_place(result.case_id);
    work.answer = results_.size() - 1;
    const std::optional<Bytes> bytes = read_record(of, opened);
    if (!bytes) return begin(opened, std::move(work), "it had no record");
    try {
      renew(opened, *bytes, work);
    } catch (const NoneHolds& error) {
      if (!options_.begin_anew || !of.keeps_all_records()) throw;
      result.before.reset();
      result.holds.reset();
      result.later_entries = 0;
      begin(opened, std::move(work), error.what());
    }
  }

  void renew(const CaseFolder& opened, const Bytes& bytes, EvidenceWork work) {
    EvidenceRenewal& result = results_.back();
    evidence::RecordParse parse = evidence::parse_record(bytes);
    if (!parse.record) throw NoneHolds(work.file + " is no evidence record: " + parse.explanation);
    const evidence::RecordJudgement alone = evidence::judge_record(*parse.record, {}, rules());
    if (!alone.problems.empty()) refuse_unless_it_holds(work.file, alone);
    work.outside = alone.outside();
    const evidence::Due due = evidence::what_is_due(alone, options_.policy, options_.now());
    result.before = work.end = due.before;
    result.text = due.reason;
    if (due.what == evidence::Due::What::kNothing) {
      const std::uint64_t newest = require_note(opened, *parse.record, work.file);
      result.later_entries = count_later(opened, *parse.record, newest);
      if (options_.take_in && result.later_entries > 0) {
        take_in(opened, std::move(*parse.record), std::move(work), bytes.size());
        return;
      }
      result.what = What::kNothingDue;
      result.text = due.before ? "to be renewed before " + format_utc(*due.before) : "no end is known";
    } else if (due.what == evidence::Due::What::kTimeStampRenewal) {
      CaseData data = read_case_data(opened);
      result.later_entries = count_later(opened, data, *parse.record);
      if (options_.take_in && result.later_entries > 0) {
        take_in(opened, std::move(*parse.record), std::move(work), bytes.size());
        return;
      }
      result.what = What::kTimeStampRenewed;
      std::erase_if(data.files, [](const NamedFile& named) { return named.stated.has_value(); });
      judge(opened, data, *parse.record, work.file);
      work.newest = evidence::newest_of(*parse.record);
      work.chosen = crypto::sha256(bytes);
      stamped_.push_back(std::move(work));
    } else if (due.what == evidence::Due::What::kHashTreeRenewal) {
      result.what = What::kHashTreeRenewed;
      require_new_hash(alone.data_hash_end);
      hash_anew(opened, std::move(*parse.record), std::move(work));
      held_ += 2 * bytes.size();
    } else {
      refuse_record(work.file, due.reason);
    }
  }

  void begin(const CaseFolder& folder, EvidenceWork work, const std::string& why) {
    EvidenceRenewal& result = results_.back();
    const CaseData data = read_case_data(folder);
    if (!data.close) throw StillOpen("it is being recorded, or was not closed");
    require_new_hash({});
    result.what = What::kBegun;
    result.text = why;
    if (options_.dry_run) return;
    const FileHashes taken = require_sound(folder, nullptr);
    work.data = hash_data(folder, data, {}, taken);
    held_ += work.data.size() * kBytesOfValue;
    begun_.push_back(std::move(work));
  }

  /// Entries behind the record, of which nothing is due: by the same hash or another one.
  void take_in(const CaseFolder& folder, EvidenceRecord record, EvidenceWork work, std::size_t bytes) {
    EvidenceRenewal& result = results_.back();
    const std::uint64_t later = std::exchange(result.later_entries, 0);
    result.what = What::kHashTreeRenewed;
    result.text = std::to_string(later) + (later == 1 ? " entry" : " entries") + " came after what it covers";
    require_new_hash({});
    hash_anew(folder, std::move(record), std::move(work));
    held_ += 2 * bytes;
  }

  void hash_anew(const CaseFolder& folder, EvidenceRecord record, EvidenceWork work) {
    if (options_.dry_run) return;
    const CaseData data = read_case_data(folder);
    const FileHashes taken = require_sound(folder, &record);
    const CaseEvidence judged = judge(folder, data, record, work.file, taken);
    work.data = hash_data(folder, data, judged.covered_lines, taken);
    work.record = std::move(record);
    held_ += work.data.size() * kBytesOfValue;
    hashed_.push_back(std::move(work));
  }

  [[noreturn]] void refuse_record(const std::string& file, const std::string& why) const {
    const bool stays = case_of(results_.size() - 1).keeps_all_records();
    throw NoneHolds(file + " does not hold: " + why +
                    "; see whether the policy and the roots are the right ones, and find out what became of "
                    "it; to have a new one begun" +
                    (stays ? " beside it, renew with --begin-anew" : ", keep this one elsewhere"));
  }
  /// A record that could not be checked may hold: it is the only proof of the years before, and whoever moves
  /// it away loses them.
  [[noreturn]] static void leave_unchecked(const std::string& file, const std::string& why) {
    throw NoneHolds(
        "whether " + file + " holds could not be checked: " + why +
        "; leave it where it is until that is known: as a rule a root of its authority is missing in "
        "trust.pem, or this machine's clock is wrong");
  }
  [[noreturn]] void refuse_unless_it_holds(const std::string& file,
                                           const evidence::RecordJudgement& judged) const {
    const evidence::Standing standing = judged.standing();
    const auto worst = std::ranges::find(judged.problems, standing, &evidence::Problem::standing);
    // One that lapsed proves nothing any more, whatever is looked at.
    if (standing == evidence::Standing::kCouldNotCheck && worst->code != "record-lapsed")
      leave_unchecked(file, worst->text);
    refuse_record(file, worst->text);
  }
  CaseEvidence judge(const CaseFolder& folder, const CaseData& data, const EvidenceRecord& record,
                     const std::string& file, const FileHashes& taken = {}) const {
    CaseEvidence judged = judge_case_evidence(folder, data, record, rules(), taken);
    if (judged.could_not_check) leave_unchecked(file, judged.refusal);
    if (!judged.refusal.empty()) refuse_record(file, judged.refusal);
    return judged;
  }

  /// Throws where the policy's new hash does not count now, or no longer than the one that it replaces.
  void require_new_hash(const std::optional<UtcTime>& old_end) const {
    const std::string name(crypto::hash_name(options_.policy.new_hash()));
    const evidence::Term term = options_.policy.hash(name);
    if (!term.holds_at(options_.now())) {
      throw Error("the policy's new hash, " + name + ", does not count any more: name another one");
    }
    if (old_end && term.end && *term.end <= *old_end) {
      throw Error("the policy's new hash, " + name + ", ends at " + format_utc(*term.end) +
                  ", no later than the one that it would replace: name another one");
    }
  }

  /// Throws where the case is not closed, not as its ledger states, or cannot be read. Returns what its files
  /// hash to under all that is asked for next, so that each of them is read once: by the policy's new hash,
  /// and by those of `record`, which may be null.
  FileHashes require_sound(const CaseFolder& folder, const EvidenceRecord* record) const {
    AlsoHash also;
    VerifyOptions options;
    options.trust = options_.trust;
    options.files = &case_of(results_.size() - 1).files();
    options.now = options_.now();
    add_hash(also.algorithms, options_.policy.new_hash());
    for (std::size_t i = 0; record != nullptr && i < record->chains.size(); ++i)
      add_hash(also.algorithms, evidence::hash_of_chain(record->chains[i]));
    const VerificationReport report = verify_case(folder.path(), options, also);
    const Finding* first = nullptr;
    const Finding* open = nullptr;
    std::vector<std::string> unread;
    for (const Finding& finding : report.findings) {
      if (finding.severity == Severity::kIncomplete && open == nullptr) open = &finding;
      if (finding.severity != Severity::kTampered && finding.code != "file-unreadable") continue;
      if (first == nullptr) first = &finding;
      if (!finding.file.empty() && std::ranges::find(unread, finding.file) == unread.end()) {
        unread.push_back(finding.file);
      }
    }
    if (first != nullptr) {
      throw Unread(
          folder.path().string() + " is " + std::string(verdict_name(report.verdict)) + ": " + first->text,
          std::move(unread));
    }
    if (open != nullptr) throw StillOpen(open->text);
    return std::move(also.taken);
  }

  /// Throws where the record does not hold a note of its case: then it is another's. Returns the size of the
  /// newest note.
  std::uint64_t require_note(const CaseFolder& folder, const EvidenceRecord& record,
                             const std::string& file) const {
    std::optional<std::uint64_t> smallest;
    std::uint64_t newest = 0;
    const FileReading& files = case_of(results_.size() - 1).files();
    for (const std::string& name : files.names_in(folder.path() / kCheckpointsFolder)) {
      const auto size = size_of_note_name(name);
      if (size && *size > 0 && (!smallest || *size < *smallest)) smallest = size;
      newest = std::max(newest, size.value_or(0));
    }
    const evidence::ArchiveTimeStamp& first = record.chains.front().front();
    const auto algorithm = evidence::hash_of_chain(record.chains.front());
    if (!smallest || !algorithm || first.reduced_tree.empty()) {
      refuse_record(file, "whether it is of this case cannot be told");
    }
    const Bytes hash = hash_named_file(folder, {note_path(*smallest), *smallest - 1, {}}, *algorithm);
    if (std::ranges::find(first.reduced_tree.front(), hash) == first.reduced_tree.front().end()) {
      refuse_record(file, "it does not cover " + note_path(*smallest) + " of this case: it is another's");
    }
    return newest;
  }

  /// How many entries lie behind all that the record covers. A first chain that holds the newest note covers
  /// all that was signed when it began, and is the usual case: no ledger is read for it.
  static std::uint64_t count_later(const CaseFolder& folder, const EvidenceRecord& record,
                                   std::uint64_t newest) {
    const evidence::HashList& list = record.chains.front().front().reduced_tree.front();
    const Bytes hash = hash_named_file(folder, {note_path(newest), newest - 1, {}},
                                       *evidence::hash_of_chain(record.chains.front()));
    if (std::ranges::find(list, hash) != list.end()) return 0;
    return count_later(folder, read_case_data(folder), record);
  }
  /// Of those that a checkpoint covers: what nobody signed is no record's.
  static std::uint64_t count_later(const CaseFolder& folder, const CaseData& data,
                                   const EvidenceRecord& record) {
    const std::uint64_t is_signed = data.note_sizes.empty() ? 0 : data.note_sizes.back();
    return is_signed - std::min(is_signed, covered_lines(folder, data, record));
  }

  /// Of all data of the case as it is now, with the beginnings of its ledger that older chains cover. The
  /// case was verified, so what its ledger states of files is their SHA-256.
  [[nodiscard]] evidence::HashList hash_data(const CaseFolder& folder, const CaseData& data,
                                             std::vector<std::uint64_t> beginnings,
                                             const FileHashes& taken) const {
    const crypto::HashAlgorithm algorithm = options_.policy.new_hash();
    if (data.note_sizes.empty()) throw Error(folder.path().string() + " has no checkpoint");
    const std::uint64_t newest = data.note_sizes.back();
    if (beginnings.empty() || beginnings.back() < newest) beginnings.push_back(newest);
    evidence::HashList values;
    for (auto& [size, hash] : hash_ledger_at(folder, beginnings, algorithm)) values.push_back(hash);
    std::string why;
    std::vector<std::string> unread;
    for (const NamedFile& named : data.files) {
      if (named.entry >= newest) continue;
      if (algorithm == crypto::HashAlgorithm::kSha256 && named.stated) {
        values.push_back(to_bytes(ByteView(named.stated->sha256)));
        continue;
      }
      if (const auto known = taken.find({named.file, algorithm}); named.stated && known != taken.end()) {
        values.push_back(known->second);
        continue;
      }
      try {
        values.push_back(hash_named_file(folder, named, algorithm));
      } catch (const Error& error) {
        if (unread.empty()) why = error.what();
        unread.push_back(named.file);
      }
    }
    if (!unread.empty()) {
      throw Unread(why + (unread.size() > 1 ? " (" + std::to_string(unread.size()) + " files in all)" : ""),
                   std::move(unread));
    }
    return values;
  }

  /// Beginnings and hash-tree renewals: one token for each of the two.
  void stamp_data() {
    const auto take_groups = [](std::vector<EvidenceWork>& works) {
      std::vector<evidence::HashList> groups;
      for (EvidenceWork& work : works) groups.push_back(std::move(work.data));
      return groups;
    };
    const crypto::HashAlgorithm algorithm = options_.policy.new_hash();
    finish(begun_, [&] { return evidence::begin_records(algorithm, take_groups(begun_), options_.stamp); });
    finish(hashed_, [&] {
      std::vector<EvidenceRecord> records;
      for (EvidenceWork& work : hashed_) records.push_back(std::move(work.record));
      return evidence::renew_hash_trees(std::move(records), algorithm, take_groups(hashed_), options_.stamp);
    });
    held_ = 0;
  }

  /// Time-stamp renewals: one token for all of one hash.
  void stamp_newest() {
    std::map<crypto::HashAlgorithm, std::vector<EvidenceWork>> by_algorithm;
    for (EvidenceWork& work : stamped_) by_algorithm[work.newest.algorithm].push_back(std::move(work));
    stamped_.clear();
    for (auto& [algorithm, group] : by_algorithm) {
      auto& works = group;  // which lambdas can hold
      std::vector<evidence::HashList> groups;
      for (const EvidenceWork& work : works) groups.push_back({work.newest.hash});
      std::vector<evidence::ArchiveTimeStamp> made;
      if (!stamped(works, [&, algorithm = algorithm] {
            made = evidence::stamp_groups(algorithm, std::move(groups), options_.stamp);
          })) {
        continue;
      }
      for (std::size_t i = 0; i < works.size(); ++i) {
        guard(results_[works[i].answer], [&] { append_to_record(works[i], std::move(made[i])); });
      }
    }
  }

  void append_to_record(const EvidenceWork& work, evidence::ArchiveTimeStamp made) {
    for (const Bytes& bytes : case_of(work.answer).read_records(results_[work.answer].case_id)) {
      if (crypto::sha256(bytes) != work.chosen) continue;
      evidence::RecordParse parse = evidence::parse_record(bytes);
      if (!parse.record) break;
      parse.record->chains.back().push_back(std::move(made));
      write(work, *parse.record);
      return;
    }
    throw Error(work.file + " was changed while its renewal was asked for: find out by what");
  }

  template <typename Make>
  void finish(std::vector<EvidenceWork>& works, const Make& make) {
    if (works.empty()) return;
    std::vector<EvidenceRecord> records;
    if (stamped(works, [&] { records = make(); })) {
      for (std::size_t i = 0; i < works.size(); ++i) {
        guard(results_[works[i].answer], [&] { write(works[i], records[i]); });
      }
    }
    works.clear();
  }

  /// Whether a token came; else each of these cases waits.
  template <typename Make>
  bool stamped(const std::vector<EvidenceWork>& works, const Make& make) {
    try {
      make();
      return true;
    } catch (const Error& error) {
      const std::string why = error.what();
      for (const EvidenceWork& work : works) {
        guard(results_[work.answer], [&] { throw RenewalWaits("no time-stamp came: " + why); });
      }
      return false;
    }
  }

  void write(const EvidenceWork& work, const EvidenceRecord& record) {
    const evidence::RecordJudgement judged = evidence::judge_record(record, {}, rules());
    if (!judged.problems.empty()) {
      throw RenewalWaits("the time-stamp that came would not hold: " + judged.problems.front().text);
    }
    EvidenceRenewal& result = results_[work.answer];
    if (work.outside && !judged.outside()) {
      throw RenewalWaits(
          "the recorder's own authority alone answered, and its time-stamp would make the record "
          "self-issued: add an outside [[authority]] to kiroku.toml");
    }
    if (result.what == What::kTimeStampRenewed && work.end && judged.end && judged.end->time <= *work.end) {
      throw RenewalWaits("the time-stamp that came lasts no longer than the record, because " +
                         judged.end->of + " ends at " + format_utc(judged.end->time) +
                         ": add another [[authority]] to kiroku.toml");
    }
    result.before = judged.end ? std::optional(judged.end->time) : std::nullopt;
    const Bytes bytes = evidence::encode_record(record);
    case_of(work.answer).write_record(result.case_id, bytes);
    result.holds = crypto::sha256(bytes);
  }

  const std::vector<std::unique_ptr<RenewableCase>>& cases_;
  const EvidenceRenewalOptions& options_;
  std::vector<EvidenceRenewal> results_;
  std::vector<EvidenceWork> begun_, stamped_, hashed_;
  std::size_t held_ = 0;
};

}  // namespace

std::string_view name_of(EvidenceRenewal::What what) {
  switch (what) {
    case What::kBegun:
      return "begun";
    case What::kTimeStampRenewed:
      return "time-stamp-renewed";
    case What::kHashTreeRenewed:
      return "hash-tree-renewed";
    case What::kNothingDue:
      return "nothing-due";
    case What::kStillOpen:
      return "still-open";
    case What::kWaits:
      return "waits";
    case What::kRefused:
      break;
  }
  return "refused";
}

EvidenceLock EvidenceLock::take(FileSystem& files, const fs::path& archive) {
  const fs::path folder = archive / kEvidenceFolder;
  if (!files.is_folder(folder)) {
    files.make_folder(folder);
    files.sync_folder(archive);
  }
  const fs::path file = folder / ".renewal";
  std::unique_ptr<WritableFile> opened;
  try {
    opened = files.exists(file) ? files.append_to(file) : files.create(file);
  } catch (const IoError& error) {
    if (error.error_number() != EEXIST) throw;
    opened = files.append_to(file);  // another process made it at this moment
  }
  if (!opened->try_lock()) {
    throw UsageError("another process renews evidence records in " + folder.string() +
                     ": wait until it has ended");
  }
  return EvidenceLock(std::move(opened));
}

std::vector<EvidenceRenewal> renew_evidence(const std::vector<std::unique_ptr<RenewableCase>>& cases,
                                            const EvidenceRenewalOptions& options) {
  return EvidenceRenewer(cases, options).run();
}

std::vector<EvidenceRenewal> renew_evidence(FileSystem& files, const std::vector<fs::path>& cases,
                                            const EvidenceRenewalOptions& options) {
  std::vector<std::unique_ptr<RenewableCase>> in_folders;
  in_folders.reserve(cases.size());
  for (const fs::path& folder : cases) in_folders.push_back(std::make_unique<CaseInFolder>(files, folder));
  return renew_evidence(in_folders, options);
}

}  // namespace kiroku::archive
