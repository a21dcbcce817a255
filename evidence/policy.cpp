#include "evidence/policy.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <variant>

#include "base/error.h"
#include "base/printable.h"
#include "evidence/policy_text.h"

namespace kiroku::evidence {
namespace {

constexpr std::array<std::string_view, 6> kKeys{"rsa", "dsa", "ecdsa", "ed25519", "ed448", "ml-dsa-44"};
constexpr std::int64_t kMostRenewalDays = 3650;
constexpr std::int64_t kMostKeyBits = 65536;

bool is_key(std::string_view name) { return std::ranges::find(kKeys, name) != kKeys.end(); }

/// What one file says, and where, for its refusals.
class PolicyKeys {
 public:
  PolicyKeys(const PolicyTable& table, const std::string& file) : table_(table), file_(file) {}

  [[noreturn]] void refuse(const PolicyPlace& at, const std::string& sentence) const {
    refuse_policy(file_, at, sentence);
  }
  void refuse_unknown(std::initializer_list<std::string_view> known) const {
    for (const PolicyValue& each : table_.values) {
      if (std::ranges::find(known, each.key) != known.end()) continue;
      std::string names;
      for (const std::string_view one : known) names += (names.empty() ? "" : ", ") + std::string(one);
      refuse(each.key_place, "unknown key '" + printable(each.key) + "'; known are " + names);
    }
  }
  [[nodiscard]] std::optional<std::string> text(std::string_view key) const {
    const PolicyValue* value = table_.find(key);
    if (value == nullptr) return {};
    const auto* text = std::get_if<std::string>(&value->value);
    if (text == nullptr) refuse(value->place, "'" + std::string(key) + "' must be a text in quotation marks");
    return *text;
  }
  [[nodiscard]] std::optional<std::int64_t> number(std::string_view key, std::int64_t most) const {
    const PolicyValue* value = table_.find(key);
    if (value == nullptr) return {};
    const auto* number = std::get_if<std::int64_t>(&value->value);
    if (number == nullptr || *number < 0 || *number > most) {
      refuse(value->place,
             "'" + std::string(key) + "' must be a whole number from 0 to " + std::to_string(most));
    }
    return *number;
  }
  /// The end of the day that is named: the first moment after it, in UTC.
  [[nodiscard]] std::optional<UtcTime> end_of_day(std::string_view key) const {
    const PolicyValue* value = table_.find(key);
    if (value == nullptr) return {};
    const auto* day = std::get_if<PolicyDay>(&value->value);
    if (day == nullptr)
      refuse(value->place, "'" + std::string(key) + "' must be a day from 1970 on, as 2040-12-31");
    return day->begins + std::chrono::days(1);
  }

 private:
  const PolicyTable& table_;
  const std::string& file_;
};

}  // namespace

Policy Policy::without_ends() {
  Policy policy;
  policy.name_ = "no policy: no algorithm ends";
  for (const crypto::HashAlgorithm algorithm : crypto::kHashAlgorithms) {
    policy.entries_.push_back({std::string(crypto::hash_name(algorithm)), 0, {}});
  }
  for (const std::string_view key : kKeys) policy.entries_.push_back({std::string(key), 0, {}});
  return policy;
}

Policy Policy::parse(std::string_view text, const std::string& name_for_errors) {
  if (text.size() > kMaximumPolicyBytes) {
    throw UsageError(name_for_errors + " is no policy of algorithms: it has more than 1 MiB");
  }
  const PolicyText read = read_policy_text(text, name_for_errors);
  const PolicyKeys top(read.top, name_for_errors);
  if (const PolicyValue* list = read.top.find("algorithm"))
    top.refuse(list->key_place, "write each algorithm as a table, [[algorithm]] with its name");
  top.refuse_unknown({"name", "publisher", "issued", "renew_before_days", "new_hash"});
  Policy policy;
  policy.given_ = true;
  policy.name_ = top.text("name").value_or(name_for_errors);
  static_cast<void>(top.text("publisher"));
  static_cast<void>(top.end_of_day("issued"));
  if (const auto days = top.number("renew_before_days", kMostRenewalDays)) {
    policy.renew_before_ = std::chrono::days(*days);
  }

  if (read.algorithms.empty()) {
    throw UsageError(name_for_errors +
                     " is no policy of algorithms: write each one as a table, [[algorithm]] with its name");
  }
  for (const PolicyTable& table : read.algorithms) {
    const PolicyKeys keys(table, name_for_errors);
    keys.refuse_unknown({"name", "minimum_bits", "until"});
    const auto name = keys.text("name");
    if (!name) keys.refuse(table.place, "an [[algorithm]] has no 'name'; write one, as name = \"sha256\"");
    const bool hash = crypto::hash_named(*name).has_value();
    if (!hash && !is_key(*name)) {
      keys.refuse(table.place,
                  "'" + printable(*name) +
                      "' is no algorithm known here; known are sha256, sha384, sha512, sha3-256, "
                      "sha3-384, sha3-512, rsa, dsa, ecdsa, ed25519, ed448 and ml-dsa-44");
    }
    const auto bits = keys.number("minimum_bits", kMostKeyBits);
    if (bits && hash) keys.refuse(table.place, "a hash has no 'minimum_bits'; leave it out");
    policy.entries_.push_back({*name, static_cast<int>(bits.value_or(0)), keys.end_of_day("until")});
  }
  const auto first_hash = std::ranges::find_if(
      policy.entries_, [](const Entry& entry) { return crypto::hash_named(entry.name).has_value(); });
  if (first_hash == policy.entries_.end()) {
    throw UsageError(name_for_errors + " is no policy of algorithms: it lists no hash");
  }
  policy.new_hash_ = *crypto::hash_named(first_hash->name);
  if (const auto name = top.text("new_hash")) {
    const auto hash = crypto::hash_named(*name);
    if (!hash || !policy.hash(*name).listed) {
      top.refuse(read.top.find("new_hash")->place,
                 "'new_hash' must be one of the hashes that the policy lists");
    }
    policy.new_hash_ = *hash;
  }
  return policy;
}

Term Policy::find(std::string_view name, int bits) const {
  Term term;
  for (const Entry& entry : entries_) {
    if (entry.name != name || bits < entry.minimum_bits) continue;
    // Of several that fit the latest end counts (RFC 5698 section 4.2: any evaluation that holds).
    const bool later = !term.listed || !entry.end || (term.end && *entry.end > *term.end);
    if (later && !(term.listed && !term.end)) term.end = entry.end;
    term.listed = true;
  }
  return term;
}

Term Policy::hash(std::string_view name) const { return find(name, 0); }

Term Policy::signature(const timestamp::SignatureUse& use) const {
  Term term = is_key(use.key) ? find(use.key, use.bits) : Term{};
  if (use.hash.empty()) return term;
  const Term over = hash(use.hash);
  term.listed = term.listed && over.listed;
  if (over.end && (!term.end || *over.end < *term.end)) term.end = over.end;
  return term;
}

std::string words_of(const timestamp::SignatureUse& use) {
  std::string words = use.key;
  if (use.key == "rsa" || use.key == "dsa" || use.key == "ecdsa") {
    words += " with " + std::to_string(use.bits) + " bits";
  }
  return use.hash.empty() ? words : words + " over " + use.hash;
}

}  // namespace kiroku::evidence
