#include "viewer/kept/log_of_case.h"

#include <algorithm>
#include <chrono>
#include <variant>

#include "archive/format/log_entry.h"
#include "archive/writing/log_reading.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"

namespace kiroku::compare {
namespace {

constexpr std::string_view kDeed = "compared with a plan, document sha256 ";

std::optional<crypto::Sha256Digest> document_of(const archive::AccessEntry& entry) {
  if (!entry.what.starts_with(kDeed)) return {};
  const auto bytes = crypto::from_hex(std::string_view(entry.what).substr(kDeed.size()));
  crypto::Sha256Digest digest{};
  if (!bytes || bytes->size() != digest.size()) return {};
  std::ranges::copy(*bytes, digest.begin());
  return digest;
}

}  // namespace

std::string comparison_deed(const crypto::Sha256Digest& document) {
  return std::string(kDeed) + crypto::to_hex(document);
}

LogOfCase read_log_of_case(const std::filesystem::path& log_folder, const archive::OpenEntry& open,
                           const crypto::VerifierKey& device) {
  LogOfCase log;
  crypto::MerkleFrontier tree;
  const auto look_at_head = [&] {
    if (tree.size() == open.appliance_log_size) {
      log.case_began_under_it = tree.root() == open.appliance_log_root;
    }
  };
  look_at_head();
  const auto keep = [&](std::map<crypto::Sha256Digest, LogOfCase::Record>& records,
                        const crypto::Sha256Digest& what, const archive::LogLine& line,
                        const std::string& who) {
    const auto known = records.find(what);
    if (known != records.end() && known->second.is_signed) return;
    const bool is_signed = archive::is_signed_entry(log_folder, device, line.seq, tree.root());
    if (known == records.end() || is_signed) records[what] = {line.seq, line.utc, who, is_signed};
  };
  archive::for_each_log_line(log_folder, [&](const archive::LogLine& line) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    look_at_head();
    if (line.type != "plan-sealed" && line.type != "access" && line.type != "case-opened") return;
    const archive::LogEntryParse parsed = archive::parse_log_entry(line.json);
    if (!parsed.entry) return;  // the log's verification says so
    if (const auto* const opened = std::get_if<archive::CaseOpenedEntry>(&parsed.entry->body)) {
      if (opened->case_id != open.case_id || (log.opening && log.opening->is_signed)) return;
      const bool is_signed = archive::is_signed_entry(log_folder, device, line.seq, tree.root());
      if (!log.opening || is_signed) log.opening = {opened->sha256, is_signed};
      return;
    }
    if (const auto* const plan = std::get_if<archive::PlanSealedEntry>(&parsed.entry->body)) {
      keep(log.sealed_plans, plan->sha256, line, {});
    } else if (const auto* const access = std::get_if<archive::AccessEntry>(&parsed.entry->body)) {
      const auto document = document_of(*access);
      if (document && access->case_id == open.case_id) keep(log.comparisons, *document, line, access->who);
    }
  });
  return log;
}

std::vector<Check> check_sealed_before(const LogOfCase& log, const std::string& device,
                                       const CaseOpening& opening, const crypto::Sha256Digest& seal) {
  using Answer = Check::Answer;
  const archive::OpenEntry& open = opening.open;
  const archive::Moment& opened = opening.at;
  if (device != open.device) {
    return {{"order", Answer::kUnknown,
             "which came first is known to the log of the appliance that recorded the case"}};
  }
  if (!log.opening) {
    return {{"opening", Answer::kUnknown,
             "the appliance log does not know that " + open.case_id +
                 " was opened, so nothing shows that its first entry is the recorded one"}};
  }
  if (log.opening->sha256 != opening.sha256) {
    return {{"opening", log.opening->is_signed ? Answer::kDiffers : Answer::kUnknown,
             "the first entry of " + open.case_id +
                 ", which names the plan, is not the one that the appliance log states"}};
  }
  if (!log.opening->is_signed) {
    return {{"opening", Answer::kUnknown,
             "nobody signed in the appliance log that " + open.case_id +
                 " was opened, before another entry followed there"}};
  }
  if (!log.case_began_under_it) {
    return {{"opening", Answer::kDiffers,
             "the appliance log is not the one that " + open.case_id + " was begun under"}};
  }
  const auto record = log.sealed_plans.find(seal);
  if (record == log.sealed_plans.end())
    return {{"order", Answer::kUnknown, "the appliance log knows no seal of this plan"}};
  const auto& [seq, utc, who, is_signed] = record->second;
  // What the case's first entry states the root of needs no other signature.
  if (seq >= open.appliance_log_size) {
    return {{"order", Answer::kDiffers, "the plan was sealed after the case had begun", seq,
             open.appliance_log_size, utc}};
  }
  const auto ahead = std::chrono::ceil<UtcTime::duration>(
      std::chrono::nanoseconds(open.begins_ns > 0 ? opened.mono_ns - open.begins_ns : 0));
  const bool recorded_ahead = ahead > UtcTime::duration::zero();
  std::vector<Check> checks{
      {"order", Answer::kHolds,
       "sealed before " + std::string(recorded_ahead ? "the case was opened" : "the first picture") +
           ": the case begins with a log of " + std::to_string(open.appliance_log_size) +
           " entries, the seal is entry " + std::to_string(seq),
       seq, open.appliance_log_size, utc}};
  if (recorded_ahead) {
    const bool older = utc < opened.utc - ahead;
    checks.push_back({"ahead", older ? Answer::kHolds : Answer::kDiffers,
                      std::to_string(std::chrono::ceil<std::chrono::seconds>(ahead).count()) +
                          " s of the case were recorded before it was opened, from " +
                          format_utc(opened.utc - ahead) + " on, and the plan was sealed " +
                          (older ? "before that: " : "only after that: ") + format_utc(utc) +
                          ", both by the recorder's clock",
                      seq, open.appliance_log_size, utc});
  }
  return checks;
}

}  // namespace kiroku::compare
