#include "crypto/witness_policy.h"

#include <algorithm>
#include <charconv>
#include <map>

#include "base/error.h"

namespace kiroku::crypto {
namespace {

constexpr std::string_view kNone = "none";
constexpr std::uint64_t kMostAheadS = 24ULL * 3600;

/// The items of a line, which spaces and tabs separate.
std::vector<std::string_view> items_of(std::string_view line) {
  std::vector<std::string_view> items;
  for (;;) {
    const std::size_t begin = line.find_first_not_of(" \t");
    if (begin == std::string_view::npos) return items;
    line.remove_prefix(begin);
    const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
    items.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

/// Its beginning: a word of a file that is no policy may have megabytes.
std::string beginning_of(std::string_view item) {
  constexpr std::size_t kMost = 100;
  return "'" + std::string(item.substr(0, kMost)) + (item.size() > kMost ? "\u2026'" : "'");
}

bool is_allowed(char c) {
  const auto octet = static_cast<unsigned char>(c);
  return octet == '\t' || octet == '\n' || (octet >= 0x20 && octet != 0x7f);
}

}  // namespace

class WitnessPolicy::Parser {
 public:
  Parser(std::string_view text, std::string name) : text_(text), name_(std::move(name)) {}

  WitnessPolicy parse() {
    while (!text_.empty()) {
      const std::size_t end = text_.find('\n');
      const std::string_view line = text_.substr(0, end);
      ++line_;
      if (!std::ranges::all_of(line, is_allowed)) fail("it holds a control character");
      if (end == std::string_view::npos)
        fail("the last line does not end with a newline: the file was cut off?");
      text_.remove_prefix(end + 1);
      const std::vector<std::string_view> items = items_of(line);
      if (!items.empty() && !items.front().starts_with('#')) take(items);
    }
    if (!has_quorum_) {
      throw Error(
          "cannot use " + name_ +
          " as a policy of witnesses: it has no line 'quorum NAME' ('quorum none' asks for no witness)");
    }
    return std::move(policy_);
  }

 private:
  [[noreturn]] void fail(const std::string& why) const {
    throw Error("cannot use " + name_ + " as a policy of witnesses, line " + std::to_string(line_) + ": " +
                why);
  }

  void take(const std::vector<std::string_view>& items) {
    const std::string_view what = items.front();
    if (what == "log") return take_log(items);
    if (what == "witness") return take_witness(items);
    if (what == "group") return take_group(items);
    if (what == "quorum") return take_quorum(items);
    fail(beginning_of(what) + " is none of log, witness, group, quorum");
  }

  void require_room(std::size_t count) const {
    if (count >= kMost) fail("there are more than " + std::to_string(kMost) + " of them");
  }

  void take_log(const std::vector<std::string_view>& items) {
    if (items.size() < 2 || items.size() > 3) fail("a log is 'log KEY' or 'log KEY URL'");
    require_room(policy_.logs_.size());
    Log log{key_of<VerifierKey>(items[1]), items.size() == 3 ? std::string(items[2]) : ""};
    const bool known =
        std::ranges::any_of(policy_.logs_, [&](const Log& each) { return each.key.key() == log.key.key(); });
    if (known) fail("the same key stands as a log already");
    policy_.logs_.push_back(std::move(log));
  }

  void take_witness(const std::vector<std::string_view>& items) {
    if (items.size() < 3 || items.size() > 4)
      fail("a witness is 'witness NAME KEY' or 'witness NAME KEY URL'");
    require_room(policy_.witnesses_.size());
    Witness witness{std::string(items[1]), key_of<CosignerKey>(items[2]),
                    items.size() == 4 ? std::string(items[3]) : ""};
    const bool known = std::ranges::any_of(
        policy_.witnesses_, [&](const Witness& each) { return each.key.key() == witness.key.key(); });
    if (known) fail("the same key stands as a witness already: one witness would count twice");
    define(witness.name, Member{policy_.witnesses_.size(), 0, {}});
    policy_.witnesses_.push_back(std::move(witness));
  }

  void take_group(const std::vector<std::string_view>& items) {
    if (items.size() < 4) fail("a group is 'group NAME all|any|NUMBER MEMBER...'");
    Member group;
    for (std::size_t i = 3; i < items.size(); ++i) {
      require_room(grouped_.size());
      const std::size_t member = defined(items[i]);
      if (!grouped_.emplace(member, line_).second)
        fail(beginning_of(items[i]) + " is in a group already: one witness would count twice");
      group.members.push_back(member);
    }
    const std::string_view threshold = items[2];
    if (threshold == "all") {
      group.threshold = group.members.size();
    } else if (threshold == "any") {
      group.threshold = 1;
    } else {
      const auto [end, failure] =
          std::from_chars(threshold.data(), threshold.data() + threshold.size(), group.threshold);
      if (failure != std::errc() || end != threshold.data() + threshold.size() || group.threshold < 1 ||
          group.threshold > group.members.size()) {
        fail(beginning_of(threshold) + " is neither all nor any, nor a number from 1 to " +
             std::to_string(group.members.size()));
      }
    }
    define(std::string(items[1]), std::move(group));
  }

  void take_quorum(const std::vector<std::string_view>& items) {
    if (items.size() != 2) fail("a quorum is 'quorum NAME' or 'quorum none'");
    if (has_quorum_) fail("there is a quorum already");
    has_quorum_ = true;
    if (items[1] != kNone) policy_.quorum_ = defined(items[1]);
  }

  template <typename Key>
  Key key_of(std::string_view text) const {
    try {
      return Key::parse(text);
    } catch (const UsageError& error) {
      fail(error.what());
    }
  }

  void define(const std::string& name, Member member) {
    if (name == kNone) fail("'none' is no name");
    if (!names_.emplace(name, policy_.members_.size()).second)
      fail(beginning_of(name) + " is defined already");
    policy_.members_.push_back(std::move(member));
  }
  [[nodiscard]] std::size_t defined(std::string_view name) const {
    const auto found = names_.find(name);
    if (found == names_.end()) fail(beginning_of(name) + " is not defined on a line before");
    return found->second;
  }

  std::string_view text_;
  const std::string name_;
  std::size_t line_ = 0;
  bool has_quorum_ = false;
  std::map<std::string, std::size_t, std::less<>> names_;
  std::map<std::size_t, std::size_t> grouped_;  // by member: the line of its group
  WitnessPolicy policy_;
};

WitnessPolicy WitnessPolicy::parse(std::string_view text, const std::string& name) {
  return Parser(text, name).parse();
}

bool WitnessPolicy::is_met(const std::vector<bool>& has_cosigned) const {
  if (!quorum_) return true;
  std::vector<bool> met(members_.size());
  for (std::size_t i = 0; i <= *quorum_; ++i) {
    const Member& member = members_[i];
    if (member.witness) {
      met[i] = has_cosigned.at(*member.witness);
      continue;
    }
    const auto count =
        std::ranges::count_if(member.members, [&](std::size_t each) { return static_cast<bool>(met[each]); });
    met[i] = static_cast<std::size_t>(count) >= member.threshold;
  }
  return met[*quorum_];
}

bool WitnessPolicy::has_witness_with(const Ed25519PublicKey& key) const {
  return std::ranges::any_of(witnesses_, [&](const Witness& each) {
    return each.key.algorithm() == CosignatureAlgorithm::kEd25519 && std::ranges::equal(each.key.key(), key);
  });
}

WitnessedNote judge_witnesses(const WitnessPolicy& policy, std::string_view note, std::uint64_t now_s,
                              CountedCosignatures counted) {
  WitnessedNote judged;
  std::vector<bool> has_cosigned;
  const NoteParts parts = parse_note(note);
  for (const WitnessPolicy::Witness& witness : policy.witnesses()) {
    CosignatureCheck check = check_cosignature(parts, witness.key);
    const bool counts = check.state == CosignatureCheck::State::kValid && check.time_s <= now_s + kMostAheadS;
    if (check.state == CosignatureCheck::State::kValid && !counts)
      check.state = CosignatureCheck::State::kInvalid;
    has_cosigned.push_back(counts && counted.of(witness.key.algorithm()));
    judged.cosigners.push_back({witness.key.name(), check});
  }
  judged.quorum = policy.is_met(has_cosigned);
  return judged;
}

}  // namespace kiroku::crypto
