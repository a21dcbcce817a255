#include "archive/verify/case_evidence.h"

#include <algorithm>
#include <functional>
#include <map>
#include <set>

#include "archive/format/case_layout.h"
#include "base/error.h"
#include "base/number_text.h"
#include "evidence/hash_tree.h"

namespace kiroku::archive {

namespace {

using crypto::HashAlgorithm;
using evidence::Standing;

/// Reads ledger and files once under each hash, however many chains a record has and however many beginnings
/// of the ledger it names: whoever made it chose both. What was taken while a file was checked is not read
/// again.
class RememberedHashes {
 public:
  RememberedHashes(const CaseFolder& folder, const CaseData& data, const FileHashes& taken)
      : folder_(folder), data_(data), taken_(taken) {}

  /// By the sizes of the ledger's beginnings that notes cover.
  const std::map<std::uint64_t, Bytes>& of_ledger(HashAlgorithm algorithm) {
    const auto [place, added] = ledger_.try_emplace(algorithm);
    if (added) place->second = hash_ledger_at(folder_, data_.note_sizes, algorithm);
    return place->second;
  }
  const Bytes& of_file(const NamedFile& named, HashAlgorithm algorithm) {
    // Of files without a stated hash nothing was compared, and nothing taken.
    const auto taken = named.stated ? taken_.find({named.file, algorithm}) : taken_.end();
    if (taken != taken_.end()) return taken->second;
    const auto [place, added] = files_.try_emplace({named.file, algorithm});
    if (added) place->second = hash_named_file(folder_, named, algorithm);
    return place->second;
  }

 private:
  const CaseFolder& folder_;
  const CaseData& data_;
  const FileHashes& taken_;
  std::map<HashAlgorithm, std::map<std::uint64_t, Bytes>> ledger_;
  std::map<std::pair<std::string, HashAlgorithm>, Bytes> files_;
};

/// The sizes of the ledger's beginnings that stand in the first list of a chain.
std::vector<std::uint64_t> find_covered_lines(RememberedHashes& hashes,
                                              const evidence::EvidenceRecord& record) {
  std::set<std::uint64_t> covered;
  Bytes before;
  for (const evidence::ArchiveTimeStampChain& chain : record.chains) {
    const auto algorithm = evidence::hash_of_chain(chain);
    if (algorithm && !chain.front().reduced_tree.empty()) {
      const evidence::HashList& list = chain.front().reduced_tree.front();
      const evidence::HeldValues held(list);
      const Bytes over_chains =
          before.empty() ? Bytes{} : crypto::digest(*algorithm, evidence::sequence_of_chains(before));
      for (const auto& [size, hash] : hashes.of_ledger(*algorithm)) {
        Bytes value = hash;
        if (!before.empty()) {
          append(value, over_chains);
          value = crypto::digest(*algorithm, value);
        }
        if (held.contains(value)) covered.insert(size);
      }
    }
    append(before, evidence::encode_chain(chain));
  }
  return {covered.begin(), covered.end()};
}

evidence::DataObject object_of_file(RememberedHashes& hashes, const NamedFile& named) {
  return {named.file, [&hashes, &named](HashAlgorithm algorithm) -> std::optional<Bytes> {
            if (algorithm == HashAlgorithm::kSha256 && named.stated) {
              return to_bytes(ByteView(named.stated->sha256));
            }
            return hashes.of_file(named, algorithm);
          }};
}

/// Why a record that holds for what it covers does not cover enough of the case; empty where it does.
std::string shortfall(const CaseEvidence& out, const CaseData& data, std::size_t line_objects) {
  if (out.lines == 0) return "its first time-stamp does not cover the ledger of this case";
  if (data.close && out.lines <= *data.close) {
    return "it covers the first " + std::to_string(out.lines) +
           " entries, and the case was closed in entry " + std::to_string(*data.close);
  }
  for (std::size_t i = 0; i < out.covered_files.size(); ++i) {
    const bool of_the_beginning = out.covered_files[i].entry < out.lines;
    if (of_the_beginning && out.judgement.covered_from[line_objects + i] != 0U) {
      return "its first time-stamp covers the ledger and not " + out.covered_files[i].file +
             ", which the ledger names";
    }
  }
  return {};
}

/// With which a chain of the record begins; it counts, so each of them has a token.
const evidence::TimeStampJudgement& first_of(const evidence::RecordJudgement& judgement, std::size_t chain) {
  return *std::ranges::find(judgement.time_stamps, chain, &evidence::TimeStampJudgement::chain);
}
UtcTime beginning_of(const evidence::RecordJudgement& judgement, std::size_t chain) {
  return first_of(judgement, chain).token.info->gen_time;
}

}  // namespace

std::uint64_t CaseEvidence::lines_covered_before(UtcTime end) const {
  std::uint64_t lines_before = 0;
  for (std::size_t i = 0; refusal.empty() && i < covered_lines.size(); ++i) {
    const std::optional<std::size_t>& chain = judgement.covered_from[i];
    if (chain && beginning_of(judgement, *chain) < end) lines_before = covered_lines[i];
  }
  return lines_before;
}

std::optional<Bytes> read_evidence_file(const FileReading& files, const std::filesystem::path& file) {
  if (!files.exists(file)) return {};
  const ReadableFile opened = files.open_to_read(file);
  if (opened.size() > evidence::kMaximumRecordBytes) {
    throw Error(file.string() + " is no evidence record: it has more than 32 MiB");
  }
  Bytes bytes(static_cast<std::size_t>(opened.size()));
  opened.read_wholly_at(0, bytes);
  return bytes;
}

std::uint64_t covered_lines(const CaseFolder& folder, const CaseData& data,
                            const evidence::EvidenceRecord& record) {
  const FileHashes none_taken;
  RememberedHashes hashes(folder, data, none_taken);
  const std::vector<std::uint64_t> covered = find_covered_lines(hashes, record);
  return covered.empty() ? 0 : covered.back();
}

CaseEvidence judge_case_evidence(const CaseFolder& folder, const CaseData& data,
                                 const evidence::EvidenceRecord& record, const evidence::JudgingRules& rules,
                                 const FileHashes& taken) {
  CaseEvidence out;
  RememberedHashes hashes(folder, data, taken);
  out.covered_lines = find_covered_lines(hashes, record);
  if (out.covered_lines.empty()) {
    out.judgement = evidence::judge_record(record, {}, rules);
    out.refusal = "it does not cover the ledger of this case: it is another's, or was made of other lines";
    return out;
  }
  std::ranges::copy_if(data.files, std::back_inserter(out.covered_files),
                       [&](const NamedFile& file) { return file.entry < out.covered_lines.back(); });
  std::vector<evidence::DataObject> objects;
  for (const std::uint64_t size : out.covered_lines) {
    objects.push_back({words_of_lines(size), [&hashes, size](HashAlgorithm algorithm) {
                         return std::optional(hashes.of_ledger(algorithm).at(size));
                       }});
  }
  for (const NamedFile& file : out.covered_files) objects.push_back(object_of_file(hashes, file));
  evidence::JudgingRules joining = rules;
  joining.objects_may_join = true;
  out.judgement = evidence::judge_record(record, objects, joining);
  const Standing standing = out.judgement.standing();
  if (standing != Standing::kHolds) {
    const auto worst = std::ranges::find(out.judgement.problems, standing, &evidence::Problem::standing);
    out.refusal = worst->text;
    out.could_not_check = standing == Standing::kCouldNotCheck;
  } else {
    for (std::size_t i = 0; i < out.covered_lines.size(); ++i) {
      if (out.judgement.covered_from[i] == 0U) out.lines = out.covered_lines[i];
    }
    out.refusal = shortfall(out, data, out.covered_lines.size());
  }
  return out;
}

namespace {

/// What a case rests on by itself (without the device: what its time-stamps rest on), and when the first of
/// it ended by the policy; nothing while all counts.
std::optional<std::pair<std::string, UtcTime>> what_ended(
    const evidence::Policy& policy, const std::vector<timestamp::SignatureUse>& signatures, UtcTime now,
    bool with_device = true) {
  std::optional<std::pair<std::string, UtcTime>> first;
  const auto judge = [&](const std::string& words, const evidence::Term& term) {
    if (term.holds_at(now)) return;
    const UtcTime end = term.listed && term.end ? *term.end : UtcTime();
    if (!first || end < first->second) first = {words, end};
  };
  judge("sha256", policy.hash("sha256"));
  if (with_device) judge("ed25519", policy.signature({"ed25519", 0, {}}));
  for (const timestamp::SignatureUse& use : signatures) judge(evidence::words_of(use), policy.signature(use));
  return first;
}

/// Why the record's times cannot be those of this case: it covers tokens that state later ones. Empty where
/// they can. The recorder's own authority is no measure of an outside one: its clock may be ahead.
std::string contradiction(const CaseEvidence& judged, const VerifiedCase& verified) {
  constexpr std::chrono::minutes kClocksDiffer{5};
  if (!judged.refusal.empty()) return {};
  /// Of a chain that begins with `first` and covers entries before `lines`.
  const auto of_chain = [&](const evidence::TimeStampJudgement& first, std::uint64_t lines) -> std::string {
    const bool by_outside = first.token.authority == timestamp::TimeAuthority::kOutside;
    const UtcTime since = first.token.info->gen_time;
    for (const StampedToken& token : by_outside ? verified.outside : verified.tokens) {
      if (token.entry >= lines || token.earliest() <= since + kClocksDiffer) continue;
      return std::string(first.chain == 0 ? "its first time-stamp"
                                          : "the first time-stamp of a later chain") +
             " is of " + format_utc(since) + ", and it covers the token of entry " +
             std::to_string(token.entry) + ", which is of " + format_utc(token.gen_time) +
             ": one of the two authorities states a wrong time";
    }
    return {};
  };
  std::string why = of_chain(judged.judgement.time_stamps.front(), judged.lines);
  for (std::size_t i = 0; why.empty() && i < judged.covered_lines.size(); ++i) {
    const std::optional<std::size_t>& chain = judged.judgement.covered_from[i];
    if (chain) why = of_chain(first_of(judged.judgement, *chain), judged.covered_lines[i]);
  }
  return why;
}

/// Times of a record that does not hold are not told: whoever made it chose them.
EvidenceReport report_of(const CaseEvidence& judged, const evidence::EvidenceRecord& record,
                         const std::string& file) {
  EvidenceReport report;
  report.file = file;
  report.holds = judged.refusal.empty();
  if (report.holds) {
    report.outside = judged.judgement.outside();
    report.since = judged.judgement.since();
    report.newest = judged.judgement.newest();
    if (judged.judgement.end) report.ends = judged.judgement.end->time;
    for (const evidence::TimeStampJudgement& each : judged.judgement.time_stamps) {
      const bool valid = each.token.code == timestamp::TokenCode::kValid;
      report.links.push_back({each.token.info ? std::optional(each.token.info->gen_time) : std::nullopt,
                              valid ? each.token.root_subject : std::string(),
                              valid && each.token.authority == timestamp::TimeAuthority::kOutside,
                              each.algorithm, each.kind != evidence::StampKind::kTimeStampRenewal});
    }
  }
  report.time_stamps = judged.judgement.time_stamps.size();
  for (const evidence::ArchiveTimeStampChain& chain : record.chains) {
    const auto algorithm = evidence::hash_of_chain(chain);
    report.hashes.emplace_back(algorithm ? crypto::hash_name(*algorithm) : "unknown");
  }
  report.entries = judged.lines;
  report.files = static_cast<std::uint64_t>(std::ranges::count_if(
      judged.covered_files, [&](const NamedFile& named) { return named.entry < judged.lines; }));
  report.later_entries = judged.lines;
  for (std::size_t i = 0; report.holds && i < judged.covered_lines.size(); ++i) {
    const std::optional<std::size_t>& chain = judged.judgement.covered_from[i];
    if (!chain || judged.covered_lines[i] <= report.later_entries) continue;
    report.later_entries = judged.covered_lines[i];
    report.later_since = beginning_of(judged.judgement, *chain);
  }
  return report;
}

const evidence::Policy& policy_of(const VerifyOptions& options) {
  static const evidence::Policy kNoPolicy = evidence::Policy::without_ends();
  return options.policy != nullptr ? *options.policy : kNoPolicy;
}

using Ending = std::pair<std::string, UtcTime>;
/// "ed25519, on which this case rests, ended at … by the policy '…'".
std::string words_of_end(const Ending& ended, const evidence::Policy& policy, const std::string& of_what) {
  return ended.first + ", on which " + of_what + ", " +
         (ended.second == UtcTime() ? "is not listed by the policy '"
                                    : "ended at " + format_utc(ended.second) + " by the policy '") +
         policy.name() + "'";
}
void report_ended(const Ending& ended, const evidence::Policy& policy, const std::string& of_what,
                  const std::string& why_it_matters, FindingList& findings) {
  findings.add("algorithm-ended", {}, words_of_end(ended, policy, of_what) + ", and " + why_it_matters);
}

/// Where the record lies that is to be judged.
std::filesystem::path record_of(const CaseFolder& folder, const std::string& case_id,
                                const VerifyOptions& options) {
  return options.evidence ? *options.evidence : evidence_file(folder.path(), case_id);
}

/// The record, and its hashes beside SHA-256; nothing where none of these would be needed.
struct FurtherHashes {
  std::optional<evidence::EvidenceRecord> record;
  std::vector<HashAlgorithm> algorithms;
};
FurtherHashes read_further_hashes(const CaseFolder& folder, const std::string& case_id,
                                  const VerifyOptions& options) {
  const FileReading& files = options.files != nullptr ? *options.files : real_reading();
  const std::optional<Bytes> bytes = read_evidence_file(files, record_of(folder, case_id, options));
  if (!bytes) return {};
  FurtherHashes further{evidence::parse_record(*bytes).record, {}};
  if (!further.record) return {};
  std::set<HashAlgorithm> named;
  for (const evidence::ArchiveTimeStampChain& chain : further.record->chains) {
    if (const auto algorithm = evidence::hash_of_chain(chain)) named.insert(*algorithm);
  }
  named.erase(HashAlgorithm::kSha256);
  further.algorithms.assign(named.begin(), named.end());
  return further;
}

/// The record that lies beside the case, or was given, judged by `judge`; nothing where there is none.
template <typename Judge>
std::optional<EvidenceReport> judge_record_beside(const CaseFolder& folder, const VerifiedCase& verified,
                                                  const VerifyOptions& options, CaseEvidence& judged,
                                                  const Judge& judge) {
  const std::filesystem::path file = record_of(folder, verified.case_id, options);
  EvidenceReport report;
  report.file = file.filename().string();
  try {
    const FileReading& files = options.files != nullptr ? *options.files : real_reading();
    const std::optional<Bytes> bytes = read_evidence_file(files, file);
    if (!bytes && options.evidence) throw UsageError("there is no evidence record at " + file.string());
    if (!bytes) return {};
    const evidence::RecordParse parse = evidence::parse_record(*bytes);
    if (!parse.record) {
      judged.refusal = parse.explanation;
    } else {
      judged = judge(*parse.record);
      if (judged.refusal.empty()) judged.refusal = contradiction(judged, verified);
      report = report_of(judged, *parse.record, report.file);
    }
    report.sha256 = crypto::sha256(*bytes);
  } catch (const UsageError&) {
    throw;
  } catch (const Error& error) {
    judged.refusal = error.what();
    judged.could_not_check = true;
  }
  report.refusal = judged.refusal;
  report.could_not_check = judged.could_not_check;
  return report;
}

/// Of a record that holds: "proves all 42 entries and 17 files since … by a chain of 3 time-stamps, …". What
/// rests on the recorder's own authority proves nothing to anybody else, and is not called so.
std::string words_of_holding(const EvidenceReport& report, const std::string& what) {
  const std::string chain =
      "a chain of " + std::to_string(report.time_stamps) +
      (report.time_stamps == 1 ? " time-stamp" : " time-stamps, the newest of " + format_utc(*report.newest));
  const std::string since = format_utc(*report.since);
  return report.outside
             ? "proves " + what + " since " + since + " by " + chain
             : "says, by the recorder's own word, that " + what + " were there at " + since + ": " + chain +
                   "; the recorder's own authority is among them, so these times are self-issued, "
                   "and no outside clock stands behind them";
}

void report_holding(const EvidenceReport& report, std::uint64_t entries, FindingList& findings) {
  const std::string covered = report.entries < entries ? "the first " + std::to_string(report.entries) +
                                                             " of " + std::to_string(entries) + " entries"
                                                       : "all " + std::to_string(entries) + " entries";
  const std::string later = report.later_since ? "; it covers the entries up to " +
                                                     std::to_string(report.later_entries - 1) + " since " +
                                                     format_utc(*report.later_since)
                                               : "";
  findings.add("evidence-holds", {report.file},
               "the evidence record " + report.file + " " +
                   words_of_holding(report, covered + " and " + std::to_string(report.files) + " files") +
                   later);
}

/// Once an algorithm of the time-stamps ended, anybody can have made them since: they say the time of the
/// first `kept` entries alone, whose proof the record carries on.
void withhold_time(std::uint64_t kept, VerificationReport& report) {
  report.outside_entries = std::min(report.outside_entries, kept);
  if (kept == 0) {
    report.time = TimeProof::kNone;
  } else if (report.time == TimeProof::kExternal) {
    report.time = TimeProof::kExternalInPart;
  }
  std::erase_if(report.brackets, [&](const Bracket& bracket) { return bracket.first_entry >= kept; });
  for (Bracket& bracket : report.brackets) bracket.last_entry = std::min(bracket.last_entry, kept - 1);
}

/// `of_what`: "case" or "excerpt".
void report_not_holding(const EvidenceReport& report, const std::string& of_what,
                        const VerifyOptions& options, FindingList& findings) {
  if (report.could_not_check) {
    findings.add(
        "evidence-not-checked", {report.file},
        "whether the evidence record " + report.file + " holds could not be checked: " + report.refusal);
  } else {
    findings.add(
        "evidence-refused", {report.file},
        "the evidence record " + report.file + " proves nothing of this " + of_what + ": " + report.refusal);
  }
  if (options.evidence) {
    findings.add("evidence-asked-for", {report.file},
                 report.could_not_check
                     ? "whether the evidence record that was given holds could not be checked"
                     : "the evidence record that was given does not hold for this " + of_what);
  }
}

}  // namespace

std::vector<HashAlgorithm> further_hashes_of_case(const CaseFolder& folder, const std::string& case_id,
                                                  const VerifyOptions& options) {
  try {
    FurtherHashes further = read_further_hashes(folder, case_id, options);
    if (further.algorithms.empty()) return {};
    // Another case's record is refused for its ledger: no file is hashed for it.
    if (covered_lines(folder, read_case_data(folder), *further.record) == 0) return {};
    return std::move(further.algorithms);
  } catch (const Error&) {
    return {};  // judging the record meets it again, and says so
  }
}

std::vector<HashAlgorithm> further_hashes_of_excerpt(const CaseFolder& folder, const std::string& case_id,
                                                     const VerifyOptions& options) {
  try {
    return read_further_hashes(folder, case_id, options).algorithms;
  } catch (const Error&) {
    return {};  // likewise
  }
}

void check_case_evidence(const CaseFolder& folder, const VerifiedCase& verified, const FileHashes& taken,
                         const VerifyOptions& options, FindingList& findings, VerificationReport& out) {
  const UtcTime now = options.now.value_or(utc_now());
  CaseEvidence judged;
  const std::optional<EvidenceReport> report =
      judge_record_beside(folder, verified, options, judged, [&](const evidence::EvidenceRecord& record) {
        const CaseData data = read_case_data(folder);
        if (data.lines != verified.entries || data.root != verified.root) {
          throw Error("the ledger changed while the case was verified: verify it again");
        }
        return judge_case_evidence(
            folder, data, record, {.trust = options.trust, .policy = &policy_of(options), .now = now}, taken);
      });
  const bool holds = report && report->holds;
  if (holds) {
    report_holding(*report, verified.entries, findings);
  } else if (report) {
    report_not_holding(*report, "case", options, findings);
  }
  const evidence::Policy& policy = policy_of(options);
  if (const auto ended = what_ended(policy, verified.signatures, now)) {
    const std::uint64_t kept = holds && report->outside ? judged.lines_covered_before(ended->second) : 0;
    if (kept == 0) {
      report_ended(*ended, policy, "this case rests",
                   "no evidence record of outside authorities holds that began before", findings);
    } else if (kept < verified.entries) {
      report_ended(*ended, policy, "its entries from " + std::to_string(kept) + " on rest",
                   "the evidence record covers none of them before: they can have been made since", findings);
    }
    const bool of_time = what_ended(policy, verified.signatures, now, false).has_value();
    if (of_time && kept < verified.entries) withhold_time(kept, out);
  }
  out.evidence = report;
}

CaseEvidence judge_excerpt_evidence(const CaseFolder& folder, const ExcerptData& data,
                                    const evidence::EvidenceRecord& record,
                                    const evidence::JudgingRules& rules, const FileHashes& taken) {
  CaseEvidence out;
  const std::string note = note_path(data.size);
  const CaseData none;
  RememberedHashes hashes(folder, none, taken);
  std::vector<evidence::DataObject> objects;
  for (const NamedFile& file : data.files) objects.push_back(object_of_file(hashes, file));
  const auto rests_on = std::ranges::find(data.files, note, &NamedFile::file);
  evidence::JudgingRules joining = rules;
  joining.objects_may_join = true;
  out.judgement = evidence::judge_record(record, objects, joining);
  const auto covered_from = [&](const NamedFile& file) {
    return out.judgement.covered_from[static_cast<std::size_t>(&file - data.files.data())];
  };
  if (rests_on == data.files.end() || covered_from(*rests_on) != 0U) {
    out.refusal =
        "its first time-stamp does not cover " + note +
        ", on which this excerpt rests: it is another case's, or began before these entries, and an "
        "excerpt does not show which; verify the whole case";
    out.could_not_check = true;
    return out;
  }
  if (const Standing standing = out.judgement.standing(); standing != Standing::kHolds) {
    out.refusal = std::ranges::find(out.judgement.problems, standing, &evidence::Problem::standing)->text;
    out.could_not_check = standing == Standing::kCouldNotCheck;
    return out;
  }
  for (const NamedFile& file : data.files) {
    if (covered_from(file) == 0U) continue;
    out.refusal =
        "its first time-stamp covers " + note + " and not " + file.file + ", which lies in the excerpt";
    return out;
  }
  out.lines = data.size;
  out.covered_files = data.files;
  return out;
}

void check_excerpt_evidence(const CaseFolder& folder, const VerifiedCase& verified, const ExcerptData& data,
                            const FileHashes& taken, const VerifyOptions& options, FindingList& findings,
                            VerificationReport& out) {
  const UtcTime now = options.now.value_or(utc_now());
  CaseEvidence judged;
  std::optional<EvidenceReport> report =
      judge_record_beside(folder, verified, options, judged, [&](const evidence::EvidenceRecord& record) {
        return judge_excerpt_evidence(
            folder, data, record, {.trust = options.trust, .policy = &policy_of(options), .now = now}, taken);
      });
  if (report) report->resealed = data.resealed;
  const bool holds = report && report->holds;
  if (holds) {
    std::string what = "the checkpoint over " + std::to_string(report->entries) + " entries and " +
                       std::to_string(report->files) + " files of this excerpt";
    if (data.resealed > 0)
      what += " (not its " + counted(data.resealed, "segment", "segments") + " sealed anew)";
    findings.add("evidence-holds", {report->file},
                 "the evidence record " + report->file + " " + words_of_holding(*report, what));
  } else if (report) {
    report_not_holding(*report, "excerpt", options, findings);
  }
  const evidence::Policy& policy = policy_of(options);
  if (const auto ended = what_ended(policy, verified.signatures, now)) {
    // Between its lines and its checkpoint an excerpt has SHA-256 alone, whatever covers the checkpoint.
    const bool by_sha256 = !policy.hash("sha256").holds_at(now);
    const bool renewed = holds && report->outside && *report->since < ended->second && !by_sha256;
    if (!renewed) {
      report_ended(
          *ended, policy, "this excerpt rests",
          holds && by_sha256
              ? "an excerpt ties its lines to its checkpoint by sha256 alone: verify the whole case"
              : "no evidence record of outside authorities holds that began before: verify the whole "
                "case with its record",
          findings);
      if (what_ended(policy, verified.signatures, now, false)) withhold_time(0, out);
    }
  }
  out.evidence = report;
}

void check_without_evidence(const std::string& what, const VerifyOptions& options,
                            const std::vector<timestamp::SignatureUse>& signatures, FindingList& findings) {
  if (options.evidence) {
    findings.add(
        "evidence-asked-for", {options.evidence->filename().string()},
        "the evidence record that was given was not judged: it is one of a whole case, and this is " + what);
  }
  const evidence::Policy& policy = policy_of(options);
  if (const auto ended = what_ended(policy, signatures, options.now.value_or(utc_now()))) {
    report_ended(*ended, policy, what + " rests",
                 "no evidence record covers " + what + ": verify the whole case with its record", findings);
  }
}

void take_log_findings(FindingList& of_log, const VerifyOptions& options, FindingList& findings) {
  const evidence::Policy& policy = policy_of(options);
  const auto ended = what_ended(policy, {}, options.now.value_or(utc_now()));
  if ((!options.log && !options.log_proof) || !ended) {
    findings.take_from(of_log, {});
    return;
  }
  const std::string rests = words_of_end(*ended, policy, "the appliance log rests") +
                            ", and no evidence record covers a log: anybody can have written it since";
  const Place log{"log/" + std::string(kLedgerFile), std::nullopt, std::nullopt, true};
  const std::vector<Finding> found = of_log.take();
  const auto gravest = std::ranges::max_element(found, {}, &Finding::severity);
  if (gravest == found.end() || gravest->severity == Severity::kNote) {
    findings.add("log-algorithm-ended", log, rests + "; that it knows the same of this case proves nothing");
  } else {
    findings.add(
        "log-doubted", log,
        rests + "; so what it says against this case is neither proven nor refuted: " + gravest->text);
  }
}

}  // namespace kiroku::archive
