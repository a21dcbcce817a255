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
};

struct RetentionConfiguration {
  std::vector<RetentionRule> rules;
  std::vector<std::filesystem::path> replicas;  // archives with copies of this one's cases
};

/// [[retention]], out of the whole file. Throws kiroku::UsageError with line and column.
void read_retention_rules(TableReader& top, RetentionConfiguration& into);
/// `replicas` of [storage].
void read_replicas(TableReader& storage, RetentionConfiguration& into);

/// "30d", or what every other duration is written as, but for a number without a unit; throws UsageError
/// naming `what`.
std::chrono::nanoseconds parse_age(const std::string& text, const std::string& what);

/// Nothing if one of the replicas holds the stream of the case; else why none does, a sentence. See
/// archive::why_not_replicated.
std::optional<std::string> why_not_replicated(const std::filesystem::path& case_folder,
                                              const std::string& stream,
                                              const std::vector<std::filesystem::path>& replicas);

}  // namespace kiroku::apps
