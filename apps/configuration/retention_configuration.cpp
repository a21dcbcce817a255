#include "apps/configuration/retention_configuration.h"

#include <algorithm>

#include "apps/common/format.h"
#include "apps/configuration/table_reader.h"
#include "archive/reading/replica.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::apps {
namespace {

bool may_be_months(const std::string& text) {
  return text.ends_with('m') && text.find_first_not_of("0123456789.") == text.size() - 1 && text.size() > 1;
}

std::string why_unclear(const std::string& text, const std::string& what) {
  return what + " is '" + text + "', which may be months or minutes: write " + text +
         "in for minutes, and days for months, such as 180d";
}

/// "6m", which may be months or minutes, leaves `after` at nothing and says so in `unclear`: what only erases
/// keeps nobody from recording.
RetentionRule read_rule(const toml::table& table, const std::string& file, std::string& unclear) {
  RetentionRule rule{};
  TableReader reader(table, "[[retention]]", file);
  reader.text("stream", [&](const std::string& text) { rule.stream = text; });
  reader.text("purpose", [&](const std::string& text) { rule.purpose = text; });
  reader.text("after", [&](const std::string& text) {
    if (may_be_months(text))
      unclear = why_unclear(text, "'after'");
    else
      rule.after = parse_age(text, "'after'");
  });
  reader.text("policy", [&](const std::string& text) { rule.policy = text; });
  reader.refuse_unknown_keys();
  if (rule.stream.empty() == rule.purpose.empty()) {
    reader.refuse(table.source(), "a [[retention]] needs either a 'stream' or a 'purpose'");
  }
  if (rule.after.count() == 0 && unclear.empty())
    reader.refuse(table.source(), "a [[retention]] needs 'after', such as \"30d\"");
  if (const std::optional<std::string> character = first_unprintable(rule.policy)) {
    reader.refuse(table.source(),
                  "'policy' holds " + *character +
                      ", which is obeyed or cannot be seen where it is shown: write it without");
  }
  if (rule.policy.empty()) {
    reader.refuse(table.source(), "a [[retention]] needs a 'policy': why the recording may go");
  }
  return rule;
}

}  // namespace

bool RetentionRule::concerns(const archive::StreamInfo& info) const {
  return stream.empty() ? info.purpose == purpose : info.name == stream;
}

std::string RetentionRule::of() const {
  return stream.empty() ? "the purpose '" + purpose + "'" : "the stream '" + stream + "'";
}

void read_retention_rules(TableReader& top, RetentionConfiguration& into) {
  for_each_table(top, "retention", [&](const toml::table& table) {
    const auto note = [&](const std::string& sentence) {
      into.unclear.push_back("line " + std::to_string(table.source().begin.line) +
                             ", [[retention]]: " + sentence + "; until then nothing is erased by rules");
    };
    std::string unclear;
    RetentionRule rule = read_rule(table, top.file(), unclear);
    if (!unclear.empty()) return note(unclear);
    const bool twice = std::ranges::any_of(into.rules, [&](const RetentionRule& other) {
      return other.stream == rule.stream && other.purpose == rule.purpose;
    });
    if (twice) note("it is the second one for " + rule.of() + ": leave the one that holds");
    into.rules.push_back(std::move(rule));
  });
}

void require_clear(const RetentionConfiguration& retention, const std::string& file) {
  if (!retention.unclear.empty()) throw UsageError(file + ": " + retention.unclear.front());
}

const RetentionRule* rule_for(const std::vector<RetentionRule>& rules, const archive::StreamInfo& stream) {
  const RetentionRule* longest = nullptr;
  for (const RetentionRule& each : rules) {
    if (each.concerns(stream) && (longest == nullptr || each.after > longest->after)) longest = &each;
  }
  return longest;
}

void read_replicas(TableReader& storage, RetentionConfiguration& into) {
  storage.texts("replicas", [&](const std::vector<std::string>& folders) {
    for (const std::string& folder : folders) {
      if (!folder.starts_with('/')) {
        throw UsageError("'replicas' has '" + folder + "': write the whole path of an archive's copy");
      }
      into.replicas.emplace_back(folder);
    }
  });
}

std::chrono::nanoseconds parse_age(const std::string& text, const std::string& what) {
  constexpr std::size_t kMostDigits = 5;
  // Who writes 30 means days, and would erase what is older than half a minute.
  if (!text.empty() && text.find_first_not_of("0123456789.") == std::string::npos) {
    throw UsageError(what + " is '" + text + "', which does not say of what: write 30d, 12h or 90min");
  }
  if (!text.ends_with('d')) return parse_duration(text, what);
  const std::string number = text.substr(0, text.size() - 1);
  if (number.empty() || number.size() > kMostDigits ||
      number.find_first_not_of("0123456789") != std::string::npos) {
    throw UsageError(what + " is '" + text + "': write whole days such as 30d, or 12h, 90min");
  }
  return std::chrono::hours(24) * std::stol(number);
}

std::chrono::nanoseconds parse_age_to_erase(const std::string& text, const std::string& what) {
  if (may_be_months(text)) throw UsageError(why_unclear(text, what));
  return parse_age(text, what);
}

std::string age_in_words(std::chrono::nanoseconds age) {
  using std::chrono::duration_cast;
  const auto words = [](std::int64_t count, const std::string& unit) {
    return std::to_string(count) + unit + (count == 1 ? "" : "s");
  };
  const std::int64_t seconds = duration_cast<std::chrono::seconds>(age).count();
  constexpr std::int64_t kMinute = 60, kHour = 60 * kMinute, kDay = 24 * kHour;
  if (seconds == 0) return words(duration_cast<std::chrono::milliseconds>(age).count(), " millisecond");
  if (seconds % kDay == 0) return words(seconds / kDay, " day");
  if (seconds % kHour == 0) return words(seconds / kHour, " hour");
  if (seconds % kMinute == 0) return words(seconds / kMinute, " minute");
  return words(seconds, " second");
}

std::optional<std::string> why_not_replicated(const std::filesystem::path& case_folder,
                                              const std::string& stream,
                                              const std::vector<std::filesystem::path>& replicas) {
  if (replicas.empty()) return "[storage] of kiroku.toml names no replicas";
  std::string reasons;
  for (const std::filesystem::path& replica : replicas) {
    const auto reason = archive::why_not_replicated(case_folder, stream, replica / case_folder.filename());
    if (!reason) return std::nullopt;
    reasons += (reasons.empty() ? "" : "; ") + replica.string() + ": " + *reason;
  }
  return reasons;
}

}  // namespace kiroku::apps
