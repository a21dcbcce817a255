#include "evidence/policy.h"

#include <algorithm>
#include <array>
#include <cstdint>

// The verifier alone needs no library beside OpenSSL's.
#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

#include "base/error.h"
#include "base/printable.h"

namespace kiroku::evidence {
namespace {

constexpr std::array<std::string_view, 6> kKeys{"rsa", "dsa", "ecdsa", "ed25519", "ed448", "ml-dsa-44"};
constexpr std::int64_t kMostRenewalDays = 3650;
constexpr std::int64_t kMostKeyBits = 65536;

bool is_key(std::string_view name) { return std::ranges::find(kKeys, name) != kKeys.end(); }

/// toml++ 3.3 assumes of some files what is not so (found by fuzzing): that a key follows a table's bracket,
/// and of characters beyond ASCII where they may stand. No policy needs either.
void refuse_what_toml_assumes(std::string_view text, const std::string& file) {
  constexpr std::string_view kBlanks = " \t";
  constexpr std::string_view kBegins =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-\"\x27]";
  std::size_t number = 1;
  for (std::size_t begin = 0; begin < text.size(); ++number) {
    const std::size_t end = std::min(text.find_first_of("\n\r", begin), text.size());
    std::string_view line = text.substr(begin, end - begin);
    begin = end + 1;
    for (const char c : line) {
      if ((c < 0x20 && c != '\t') || c == 0x7F) {
        throw UsageError(file + ":" + std::to_string(number) +
                         ": holds a control character, or one that is not ASCII; write it as \\u and four "
                         "hexadecimal digits");
      }
    }
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
    if (!line.starts_with('[')) continue;
    line.remove_prefix(line.starts_with("[[") ? 2 : 1);
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
    if (line.empty() || kBegins.find(line.front()) == std::string_view::npos) {
      throw UsageError(file + ":" + std::to_string(number) +
                       ": no name stands behind the bracket that begins the line");
    }
  }
}

/// Where a policy file says something, for its refusals.
struct PolicyPlace {
  const std::string& file;
  [[noreturn]] void refuse(const toml::source_region& at, const std::string& sentence) const {
    throw UsageError(file + ":" + std::to_string(at.begin.line) + ":" + std::to_string(at.begin.column) +
                     ": " + sentence);
  }
  void refuse_unknown_keys(const toml::table& table, std::initializer_list<std::string_view> known) const {
    for (const auto& [key, node] : table) {
      if (std::ranges::find(known, key.str()) != known.end()) continue;
      std::string names;
      for (const std::string_view one : known) names += (names.empty() ? "" : ", ") + std::string(one);
      refuse(key.source(), "unknown key '" + printable(key.str()) + "'; known are " + names);
    }
  }
  [[nodiscard]] std::optional<std::string> text(const toml::table& table, std::string_view key) const {
    const toml::node* node = table.get(key);
    if (node == nullptr) return {};
    const auto value = node->value_exact<std::string>();
    if (!value) refuse(node->source(), "'" + std::string(key) + "' must be a text in quotation marks");
    return *value;
  }
  [[nodiscard]] std::optional<std::int64_t> number(const toml::table& table, std::string_view key,
                                                   std::int64_t most) const {
    const toml::node* node = table.get(key);
    if (node == nullptr) return {};
    const auto value = node->value_exact<std::int64_t>();
    if (!value || *value < 0 || *value > most) {
      refuse(node->source(),
             "'" + std::string(key) + "' must be a whole number from 0 to " + std::to_string(most));
    }
    return *value;
  }
  /// The end of the day that is named: the first moment after it, in UTC.
  [[nodiscard]] std::optional<UtcTime> end_of_day(const toml::table& table, std::string_view key) const {
    const toml::node* node = table.get(key);
    if (node == nullptr) return {};
    const auto value = node->value_exact<toml::date>();
    const auto day =
        value ? std::chrono::year_month_day(std::chrono::year(value->year), std::chrono::month(value->month),
                                            std::chrono::day(value->day))
              : std::chrono::year_month_day();
    if (!value || !day.ok() || value->year < 1970) {
      refuse(node->source(), "'" + std::string(key) + "' must be a day from 1970 on, as 2040-12-31");
    }
    return std::chrono::sys_days(day) + std::chrono::days(1);
  }
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
  const PolicyPlace place{name_for_errors};
  if (text.size() > kMaximumPolicyBytes) {
    throw UsageError(name_for_errors + " is no policy of algorithms: it has more than 1 MiB");
  }
  refuse_what_toml_assumes(text, name_for_errors);
  toml::table root;
  try {
    root = toml::parse(text);
  } catch (const toml::parse_error& error) {
    place.refuse(error.source(), "is not TOML: " + printable(error.description()));
  }
  place.refuse_unknown_keys(root,
                            {"name", "publisher", "issued", "renew_before_days", "new_hash", "algorithm"});
  Policy policy;
  policy.given_ = true;
  policy.name_ = place.text(root, "name").value_or(name_for_errors);
  static_cast<void>(place.text(root, "publisher"));
  static_cast<void>(place.end_of_day(root, "issued"));
  if (const auto days = place.number(root, "renew_before_days", kMostRenewalDays)) {
    policy.renew_before_ = std::chrono::days(*days);
  }

  const toml::node* list = root.get("algorithm");
  if (list == nullptr || !list->is_array_of_tables()) {
    throw UsageError(name_for_errors +
                     " is no policy of algorithms: write each one as a table, [[algorithm]] with its name");
  }
  for (const toml::node& node : *list->as_array()) {
    const toml::table& table = *node.as_table();
    place.refuse_unknown_keys(table, {"name", "minimum_bits", "until"});
    const auto name = place.text(table, "name");
    if (!name) place.refuse(table.source(), "an [[algorithm]] has no 'name'");
    const bool hash = crypto::hash_named(*name).has_value();
    if (!hash && !is_key(*name)) {
      place.refuse(table.source(),
                   "'" + printable(*name) +
                       "' is no algorithm known here; known are sha256, sha384, sha512, sha3-256, "
                       "sha3-384, sha3-512, rsa, dsa, ecdsa, ed25519, ed448 and ml-dsa-44");
    }
    const auto bits = place.number(table, "minimum_bits", kMostKeyBits);
    if (bits && hash) place.refuse(table.source(), "a hash has no 'minimum_bits'");
    policy.entries_.push_back({*name, static_cast<int>(bits.value_or(0)), place.end_of_day(table, "until")});
  }
  const auto first_hash = std::ranges::find_if(
      policy.entries_, [](const Entry& entry) { return crypto::hash_named(entry.name).has_value(); });
  if (first_hash == policy.entries_.end()) {
    throw UsageError(name_for_errors + " is no policy of algorithms: it lists no hash");
  }
  policy.new_hash_ = *crypto::hash_named(first_hash->name);
  if (const auto name = place.text(root, "new_hash")) {
    const auto hash = crypto::hash_named(*name);
    if (!hash || !policy.hash(*name).listed) {
      place.refuse(root.get("new_hash")->source(),
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
