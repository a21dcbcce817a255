// What the lines of an appliance log state, whoever wrote them: keys, boots, cases, damage. Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "archive/format/log_entry.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/log_deeds.h"
#include "archive/writing/unsigned_lines.h"

namespace kiroku::archive {

/// Numbers, by stretches that lie apart.
class NumberSet {
 public:
  /// Of a `from` behind `to` there are none.
  void add(std::uint64_t from, std::uint64_t to) {
    if (from > to) return;
    auto each = stretches_.upper_bound(from);
    if (each != stretches_.begin() && std::prev(each)->second >= from) --each;
    while (each != stretches_.end() && each->first <= to) {
      from = std::min(from, each->first);
      to = std::max(to, each->second);
      each = stretches_.erase(each);
    }
    stretches_.emplace(from, to);
  }
  [[nodiscard]] bool contains(std::uint64_t number) const {
    const auto behind = stretches_.upper_bound(number);
    return behind != stretches_.begin() && std::prev(behind)->second >= number;
  }

 private:
  std::map<std::uint64_t, std::uint64_t> stretches_;  // from, to
};

class StatedInLog {
 public:
  using CaseState = ApplianceLog::CaseState;
  struct StatedKey {
    std::uint64_t entry = 0;
    std::string key;
  };
  struct StatedDamage {
    std::uint64_t entry = 0;
    LogDamageEntry damage;
  };
  /// What becomes of an entry's checkpoint: it follows at once, it does for an entry on which the device
  /// stands, or none is written (the next entry's covers it).
  enum class Signing { kFollows, kKept, kNone };

  /// Of the keys that this program was given.
  explicit StatedInLog(LogKeys own) : own_(std::move(own)) {}

  /// Is told each line in order; of number 0 it begins anew. Most lines are checkpoints of cases, which state
  /// nothing that is kept here.
  void look_at(std::uint64_t seq, std::string_view line);
  /// A checkpoint by the device's Ed25519 key covers so many lines.
  void is_covered_until(std::uint64_t size) { covered_until_ = size; }
  [[nodiscard]] std::uint64_t covered_until() const { return covered_until_; }

  [[nodiscard]] const std::string& newest_boot_id() const { return newest_boot_id_; }
  [[nodiscard]] const std::string& newest_device() const { return newest_device_; }
  [[nodiscard]] std::int64_t newest_mono_ns() const { return newest_mono_ns_; }
  /// Of the newest line.
  [[nodiscard]] Signing newest_signing() const { return newest_signing_; }
  [[nodiscard]] const std::vector<StatedDamage>& damages() const { return damages_; }
  [[nodiscard]] CaseState case_state(const std::string& case_id) const;

  // Each is null where no line states such a key.
  [[nodiscard]] const StatedKey* ml_dsa() const;
  [[nodiscard]] const StatedKey* hardware() const;
  /// Of several the newest that the device stands for, or its own.
  [[nodiscard]] const StatedKey* attestation() const;
  /// The first line that states the own key, be it unsigned yet.
  [[nodiscard]] const StatedKey* own_ml_dsa() const { return own_of(ml_dsa_keys_, own_.ml_dsa); }
  /// The newest line that states another key than the own, if the device stands for it.
  [[nodiscard]] const StatedKey* other_ml_dsa() const { return other_of(ml_dsa_keys_, own_.ml_dsa); }
  [[nodiscard]] const StatedKey* other_hardware() const { return other_of(hardware_keys_, own_.hardware); }

 private:
  void take_device(const std::string& named);
  void forget_keys();
  /// Whether the device stands for what an entry states: a checkpoint of its own covers it, and the device
  /// did not say later that it found the entry unsigned. Somebody may say so, too, in a line that it found.
  [[nodiscard]] bool stands_for(std::uint64_t entry) const;
  /// The entries over which the device says in later ones that it found no signature. Of thousands of such
  /// lines each is looked at once, whenever a checkpoint covers more of them.
  [[nodiscard]] const NumberSet& disowned() const;
  /// The first line that states the own key, be it unsigned yet.
  [[nodiscard]] static const StatedKey* own_of(const std::vector<StatedKey>& keys, const std::string& own);
  /// The newest line that states another key, if the device stands for it.
  [[nodiscard]] const StatedKey* other_of(const std::vector<StatedKey>& keys, const std::string& own) const;

  LogKeys own_;
  std::uint64_t covered_until_ = 0;
  std::string newest_boot_id_, newest_device_;
  std::int64_t newest_mono_ns_ = 0;
  Signing newest_signing_ = Signing::kNone;
  std::vector<StatedKey> ml_dsa_keys_, hardware_keys_, attestation_keys_;  // since it names that device
  std::vector<StatedDamage> damages_;
  struct Found {
    std::uint64_t entry = 0;
    Entries entries;
  };
  std::vector<Found> found_;  // entries over which the device found no signature
  // As of disowned():
  mutable std::optional<NumberSet> disowned_set_;
  mutable std::size_t disowned_by_ = 0;  // so many of `found_`
  std::unordered_map<std::string, CaseState> cases_;
};

}  // namespace kiroku::archive
