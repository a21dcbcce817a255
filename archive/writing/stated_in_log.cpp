#include "archive/writing/stated_in_log.h"

#include <algorithm>
#include <charconv>
#include <iterator>
#include <utility>

namespace kiroku::archive {

namespace {

/// As the line says it; 0 where it says none.
std::int64_t mono_ns_of(std::string_view line) {
  constexpr std::string_view kKey = R"("mono_ns":)";
  const std::size_t at = line.find(kKey);
  std::int64_t value = 0;
  if (at != std::string_view::npos) {
    std::from_chars(line.data() + at + kKey.size(), line.data() + line.size(), value);
  }
  return value;
}

StatedInLog::Signing signing_of(std::string_view type) {
  if (type.starts_with("boot\"") || type.starts_with("config-changed\"") ||
      type.starts_with("device-ml-dsa-added\"") || type.starts_with("device-hardware-") ||
      type.starts_with("device-attestation-added\"") || type.starts_with("recovered\"") ||
      type.starts_with("damage-found\"")) {
    return StatedInLog::Signing::kNone;
  }
  return type.starts_with("case-opened\"") || type.starts_with("device-key-changed\"")
             ? StatedInLog::Signing::kKept
             : StatedInLog::Signing::kFollows;
}

}  // namespace

void StatedInLog::look_at(std::uint64_t seq, std::string_view line) {
  if (seq == 0) {
    cases_.clear();
    newest_boot_id_.clear();
    newest_device_.clear();
    forget_keys();
    found_.clear();
    disowned_set_.reset();
    damages_.clear();
  }
  constexpr std::string_view kType = R"("type":")";
  const std::size_t at = line.find(kType);
  const std::string_view type = at == std::string_view::npos ? "" : line.substr(at + kType.size());
  newest_signing_ = signing_of(type);
  newest_mono_ns_ = mono_ns_of(line);
  if (!type.starts_with("boot\"") && !type.starts_with("device-") && !type.starts_with("case-opened\"") &&
      !type.starts_with("case-closed\"") && !type.starts_with("damage-found\"") &&
      !(type.starts_with("access\"") && line.find(kFoundBegins) != std::string_view::npos)) {
    return;
  }
  const LogEntryParse parsed = parse_log_entry(line);
  if (!parsed.entry) {
    return;
  }
  if (const auto* boot = std::get_if<BootEntry>(&parsed.entry->body)) {
    newest_boot_id_ = boot->boot_id;
    take_device(boot->device);
  } else if (const auto* added = std::get_if<DeviceMlDsaEntry>(&parsed.entry->body)) {
    ml_dsa_keys_.push_back({seq, added->ml_dsa});
  } else if (const auto* hardware = std::get_if<DeviceHardwareEntry>(&parsed.entry->body)) {
    hardware_keys_.push_back({seq, hardware->hardware});
  } else if (const auto* attests = std::get_if<DeviceAttestationEntry>(&parsed.entry->body)) {
    attestation_keys_.push_back({seq, attests->attestation});
  } else if (const auto* changed = std::get_if<DeviceKeyChangedEntry>(&parsed.entry->body)) {
    newest_device_ = changed->device;
    forget_keys();
  } else if (const auto* damaged = std::get_if<LogDamageEntry>(&parsed.entry->body)) {
    damages_.push_back({seq, *damaged});
  } else if (const auto* access = std::get_if<AccessEntry>(&parsed.entry->body)) {
    if (const std::optional<Entries> entries = entries_of_deed(access->what)) {
      found_.push_back({seq, *entries});
    }
  } else if (const auto* opened = std::get_if<CaseOpenedEntry>(&parsed.entry->body)) {
    cases_.try_emplace(opened->case_id, CaseState::kOpened);
  } else if (const auto* closed = std::get_if<CaseClosedEntry>(&parsed.entry->body)) {
    cases_[closed->case_id] = CaseState::kClosed;
  }
}

void StatedInLog::take_device(const std::string& named) {
  if (!newest_device_.empty() && newest_device_ != named) forget_keys();
  newest_device_ = named;
}

void StatedInLog::forget_keys() {
  ml_dsa_keys_.clear();
  hardware_keys_.clear();
  attestation_keys_.clear();
}

bool StatedInLog::stands_for(std::uint64_t entry) const {
  return entry < covered_until_ && !disowned().contains(entry);
}

const NumberSet& StatedInLog::disowned() const {
  const auto end =
      std::ranges::partition_point(found_, [&](const Found& each) { return each.entry < covered_until_; });
  const auto covered = static_cast<std::size_t>(end - found_.begin());
  if (disowned_set_ && disowned_by_ == covered) return *disowned_set_;
  disowned_set_.emplace();
  disowned_by_ = covered;
  // From the newest on: what a later one disowns says nothing.
  for (std::size_t at = covered; at-- > 0;) {
    const Found& each = found_[at];
    if (each.entry > 0 && !disowned_set_->contains(each.entry))
      disowned_set_->add(each.entries.from, std::min(each.entries.to, each.entry - 1));
  }
  return *disowned_set_;
}

const StatedInLog::StatedKey* StatedInLog::own_of(const std::vector<StatedKey>& keys,
                                                  const std::string& own) {
  const auto first = std::ranges::find_if(keys, [&](const StatedKey& each) { return each.key == own; });
  return own.empty() || first == keys.end() ? nullptr : &*first;
}

const StatedInLog::StatedKey* StatedInLog::other_of(const std::vector<StatedKey>& keys,
                                                    const std::string& own) const {
  const auto newest = std::find_if(keys.rbegin(), keys.rend(), [&](const StatedKey& each) {
    return each.key != own && stands_for(each.entry);
  });
  return newest == keys.rend() ? nullptr : &*newest;
}

const StatedInLog::StatedKey* StatedInLog::ml_dsa() const {
  const StatedKey* own = own_of(ml_dsa_keys_, own_.ml_dsa);
  return own != nullptr ? own : other_of(ml_dsa_keys_, own_.ml_dsa);
}

const StatedInLog::StatedKey* StatedInLog::hardware() const {
  const StatedKey* own = own_of(hardware_keys_, own_.hardware);
  return own != nullptr ? own : other_of(hardware_keys_, own_.hardware);
}

const StatedInLog::StatedKey* StatedInLog::attestation() const {
  const StatedKey* other = other_of(attestation_keys_, own_.attestation);
  return other != nullptr ? other : own_of(attestation_keys_, own_.attestation);
}

StatedInLog::CaseState StatedInLog::case_state(const std::string& case_id) const {
  const auto stated = cases_.find(case_id);
  return stated == cases_.end() ? CaseState::kUnknown : stated->second;
}

}  // namespace kiroku::archive
