// [[retention]] and [storage] replicas of kiroku.toml: what may be erased, and where its copies are.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/ledger_entry.h"

namespace kiroku::apps {

class TableReader;

/// One [[retention]]. Streams that no rule names are kept for ever.
struct RetentionRule {
  std::string stream, purpose;     // one of them is empty
  std::chrono::nanoseconds after;  // since the case was opened
  std::string policy;              // stands in the case and in the appliance log
  [[nodiscard]] bool concerns(const archive::StreamInfo& info) const;
  /// "the stream 'room'", "the purpose 'quality review'".
  [[nodiscard]] std::string of() const;
};

struct RetentionConfiguration {
  std::vector<RetentionRule> rules;
  std::vector<std::string> unclear;             // rules that may mean something else, one sentence each
  std::vector<std::filesystem::path> replicas;  // archives with copies of this one's cases
};

/// Of the rules that are for a stream the one that keeps it longest: it alone decides. Null where none is.
const RetentionRule* rule_for(const std::vector<RetentionRule>& rules, const archive::StreamInfo& stream);

/// [[retention]], out of the whole file. Throws kiroku::UsageError with line and column. Two rules of one
/// stream or of one purpose, and an age of "6m", are `unclear`.
void read_retention_rules(TableReader& top, RetentionConfiguration& into);
/// Throws kiroku::UsageError where a rule is unclear; for whoever erases by them.
void require_clear(const RetentionConfiguration& retention, const std::string& file);
/// `replicas` of [storage].
void read_replicas(TableReader& storage, RetentionConfiguration& into);

/// "30d", or what every other duration is written as, but for a number without a unit; throws UsageError
/// naming `what`.
std::chrono::nanoseconds parse_age(const std::string& text, const std::string& what);
/// The same of what is erased when it is older: refuses "6m", too, which may be months.
std::chrono::nanoseconds parse_age_to_erase(const std::string& text, const std::string& what);
/// "30 days", "12 hours", "90 minutes", "5 seconds": exact down to a second, but for what is less.
std::string age_in_words(std::chrono::nanoseconds age);

/// Nothing if one of the replicas holds the stream of the case; else why none does, a sentence. See
/// archive::why_not_replicated.
std::optional<std::string> why_not_replicated(const std::filesystem::path& case_folder,
                                              const std::string& stream,
                                              const std::vector<std::filesystem::path>& replicas);

}  // namespace kiroku::apps
