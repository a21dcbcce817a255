#include "archive/upkeep/evidence_renewal.h"

#include <algorithm>

#include "archive/verify/case_evidence.h"
#include "archive/verify/verifier.h"
#include "base/error.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;
using evidence::EvidenceRecord;
using What = EvidenceRenewal::What;

/// One case and what is to be done for it.
struct EvidenceWork {
  fs::path folder, file;
  std::size_t answer = 0;   // its place among the results
  EvidenceRecord record;    // of a renewal
  evidence::HashList data;  // of a beginning and a hash-tree renewal
};

class EvidenceRenewer {
 public:
  EvidenceRenewer(FileSystem& files, const EvidenceRenewalOptions& options)
      : files_(files), options_(options) {}

  std::vector<EvidenceRenewal> run(const std::vector<fs::path>& cases) {
    for (const fs::path& folder : cases) {
      results_.push_back({folder.filename().string(), What::kRefused, {}});
      try {
        look_at(folder);
      } catch (const Error& error) {
        results_.back().what = What::kRefused;
        results_.back().text = error.what();
      }
    }
    if (options_.dry_run) return std::move(results_);
    // Every token is there before a record is written.
    std::vector<std::pair<const EvidenceWork*, EvidenceRecord>> made;
    const auto take = [&](const std::vector<EvidenceWork>& work, std::vector<EvidenceRecord> records) {
      for (std::size_t i = 0; i < work.size(); ++i) made.emplace_back(&work[i], std::move(records[i]));
    };
    if (!begun_.empty()) {
      take(begun_, evidence::begin_records(options_.policy.new_hash(), groups_of(begun_), options_.stamp));
    }
    if (!stamped_.empty()) take(stamped_, evidence::renew_time_stamps(records_of(stamped_), options_.stamp));
    if (!hashed_.empty()) {
      take(hashed_, evidence::renew_hash_trees(records_of(hashed_), options_.policy.new_hash(),
                                               groups_of(hashed_), options_.stamp));
    }
    for (const auto& [work, record] : made) write(*work, record);
    return std::move(results_);
  }

 private:
  static std::vector<evidence::HashList> groups_of(const std::vector<EvidenceWork>& work) {
    std::vector<evidence::HashList> groups;
    for (const EvidenceWork& each : work) groups.push_back(each.data);
    return groups;
  }
  static std::vector<EvidenceRecord> records_of(const std::vector<EvidenceWork>& work) {
    std::vector<EvidenceRecord> records;
    for (const EvidenceWork& each : work) records.push_back(each.record);
    return records;
  }

  void look_at(const fs::path& folder) {
    const CaseFolder opened = CaseFolder::open(folder, files_);
    const CaseData data = read_case_data(opened);
    EvidenceRenewal& result = results_.back();
    result.case_id = data.case_id;
    EvidenceWork work{folder, evidence_file(folder, data.case_id), results_.size() - 1, {}, {}};
    const std::optional<Bytes> bytes = read_evidence_file(files_, work.file);
    if (!bytes) {
      require_sound(folder);
      work.data = hash_data(opened, data, {}, options_.policy.new_hash());
      result = {data.case_id, What::kBegun, "it had no record"};
      begun_.push_back(std::move(work));
      return;
    }
    evidence::RecordParse parse = evidence::parse_record(*bytes);
    if (!parse.record) throw Error(work.file.string() + " is no evidence record: " + parse.explanation);
    const CaseEvidence judged =
        judge_case_evidence(opened, data, *parse.record,
                            {.trust = options_.trust, .policy = &options_.policy, .now = options_.now});
    if (!judged.refusal.empty()) throw Error(work.file.string() + " does not hold: " + judged.refusal);
    const evidence::Due due = evidence::what_is_due(judged.judgement, options_.policy, options_.now);
    work.record = std::move(*parse.record);
    switch (due.what) {
      case evidence::Due::What::kNothing:
        result = {data.case_id, What::kNothingDue,
                  due.before ? "to be renewed before " + format_utc(*due.before) : "no end is known"};
        break;
      case evidence::Due::What::kTimeStampRenewal:
        result = {data.case_id, What::kTimeStampRenewed, due.reason};
        stamped_.push_back(std::move(work));
        break;
      case evidence::Due::What::kHashTreeRenewal:
        if (!options_.policy.hash(crypto::hash_name(options_.policy.new_hash())).holds_at(options_.now)) {
          throw Error("the policy's new hash, " + std::string(crypto::hash_name(options_.policy.new_hash())) +
                      ", does not count any more: name another one");
        }
        require_sound(folder);
        work.data = hash_data(opened, data, judged.covered_lines, options_.policy.new_hash());
        result = {data.case_id, What::kHashTreeRenewed, due.reason};
        hashed_.push_back(std::move(work));
        break;
      case evidence::Due::What::kTooLate:
        throw Error(work.file.string() + " came too late to be renewed: " + due.reason);
    }
  }

  /// Throws where the case is not closed, not as its ledger states, or cannot be read.
  void require_sound(const fs::path& folder) const {
    VerifyOptions options;
    options.trust = options_.trust;
    options.files = &files_;
    options.now = options_.now;
    const VerificationReport report = verify_case(folder, options);
    const auto refuse = [&](const Finding& finding) {
      throw Error(folder.string() + " is " + std::string(verdict_name(report.verdict)) + ": " + finding.text);
    };
    for (const Finding& finding : report.findings) {
      if (finding.severity >= Severity::kIncomplete || finding.code == "file-unreadable") refuse(finding);
    }
  }

  /// Of all data of the case as it is now, with the beginnings of its ledger that older chains cover.
  static evidence::HashList hash_data(const CaseFolder& folder, const CaseData& data,
                                      std::vector<std::uint64_t> beginnings,
                                      crypto::HashAlgorithm algorithm) {
    if (data.note_sizes.empty()) throw Error(folder.path().string() + " has no checkpoint");
    const std::uint64_t newest = data.note_sizes.back();
    if (beginnings.empty() || beginnings.back() < newest) beginnings.push_back(newest);
    evidence::HashList values;
    for (auto& [size, hash] : hash_ledger_at(folder, beginnings, algorithm)) values.push_back(hash);
    for (const NamedFile& named : data.files) {
      if (named.entry < newest) values.push_back(hash_named_file(folder, named, algorithm));
    }
    return values;
  }

  void write(const EvidenceWork& work, const EvidenceRecord& record) {
    const fs::path folder = work.file.parent_path();
    if (!files_.is_folder(folder)) {
      files_.make_folder(folder);
      files_.sync_folder(folder.parent_path());
    }
    files_.write_durably(work.file, evidence::encode_record(record));
  }

  FileSystem& files_;
  const EvidenceRenewalOptions& options_;
  std::vector<EvidenceRenewal> results_;
  std::vector<EvidenceWork> begun_, stamped_, hashed_;
};

}  // namespace

std::vector<EvidenceRenewal> renew_evidence(FileSystem& files, const std::vector<fs::path>& cases,
                                            const EvidenceRenewalOptions& options) {
  return EvidenceRenewer(files, options).run(cases);
}

}  // namespace kiroku::archive
