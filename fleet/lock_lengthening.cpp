#include "fleet/lock_lengthening.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/store_statement.h"
#include "archive/search/note_writer.h"
#include "base/error.h"
#include "base/printable.h"

namespace kiroku::fleet {
namespace {

/// A lock runs from before the object is sent, and the store dates it when it has it, by its own clock.
/// Stores refuse whose clock is further off ("RequestTimeTooSkewed").
constexpr std::chrono::minutes kClocksDiffer{15};
constexpr std::chrono::hours kTriedAgain{1};
/// Versions that a list names, in one go: asking for a list takes a store longer than telling of a version.
constexpr std::uint64_t kListedForOneLook = 20;
/// And where many may be looked at: more than a case of days has.
constexpr std::uint64_t kMostListed = 20 * kMostVersions;
/// A crash costs so many questions.
constexpr std::uint64_t kLooksKeptTogether = 64;

bool is_locked_until(const StoredObject& stored, UtcTime until) {
  return stored.compliance && stored.lock_ends && *stored.lock_ends >= until;
}

/// Of a file of a case: whether only those with keys can read it.
bool is_for_those_with_keys(std::string_view path) {
  return path.starts_with(std::string(archive::kSegmentsFolder) + "/") || path == archive::kSubjectFile;
}

}  // namespace

LockLengthening::LockLengthening(ObjectStore& store, ShippingList& list, std::string appliance,
                                 std::chrono::seconds retention, const Clock& clock)
    : store_(store), list_(list), prefix_(std::move(appliance) + "/"), retention_(retention), clock_(clock) {}

std::optional<ShippingList::LockLook> LockLengthening::left(ShippingList& list,
                                                            std::chrono::seconds retention) {
  std::optional<ShippingList::LockLook> look = list.lock_look();
  if (!look) {
    if (list.totals().objects == 0) return {};
    return ShippingList::LockLook{.retention = retention};
  }
  const bool all_done = look->finished && look->failed == 0;
  if (all_done && look->retention >= retention) return {};
  if (look->retention != retention) return ShippingList::LockLook{.retention = retention};
  return look;
}

/// Whether there is anything to do now, as look_ says.
bool LockLengthening::is_to_be_looked_at() {
  const std::optional<ShippingList::LockLook> known = list_.lock_look();
  if (!known) {
    // Also by a list that is new, and an archive without anything: the store may have what is not here.
    look_ = {.retention = retention_};
    return true;
  }
  const std::optional<ShippingList::LockLook> left_now = left(list_, retention_);
  if (!left_now) {
    // What is put from now on is locked for less, and counts when more is asked for again.
    if (known->retention != retention_) list_.set_lock_look({.retention = retention_, .finished = true});
    return false;
  }
  look_ = *left_now;
  if (failed_at_ && clock_.now() - *failed_at_ < kTriedAgain) return false;
  if (!look_.finished) return true;
  // Until it is known better what failed is told.
  look_ = {.retention = retention_, .problem = look_.problem};
  return true;
}

std::uint64_t LockLengthening::go_on(std::uint64_t& most, const std::function<bool()>& is_ended) {
  if (most == 0 || is_ended() || !is_to_be_looked_at()) return 0;
  const std::uint64_t before = look_.lengthened;
  std::uint64_t kept_at = look_.looked_at;
  std::uint64_t listed_left = std::min(most, kMostListed / kListedForOneLook) * kListedForOneLook;
  std::vector<ListedVersion> of_object;  // the newest in front
  const auto look_at_object = [&] {
    if (of_object.empty()) return;
    const std::string key = of_object.front().key;
    if (is_ours(key)) look_at(std::exchange(of_object, {}), most);
    of_object.clear();
    look_.after_key = key;
    if (look_.looked_at < kept_at + kLooksKeptTogether) return;
    kept_at = look_.looked_at;
    list_.set_lock_look(look_);
    list_.keep();
  };
  bool has_stopped = false;
  try {
    store_.for_each_version_after(prefix_, look_.after_key, [&](const ListedVersion& each) {
      if (!of_object.empty() && of_object.front().key != each.key) {
        look_at_object();
        has_stopped = most == 0 || listed_left == 0 || is_ended();
        if (has_stopped) return false;
      }
      if (!look_.after_key.empty() && each.key <= look_.after_key)
        throw Error("the store lists '" + printable(each.key) + "' behind '" + printable(look_.after_key) +
                    "': its lists are in no order");
      if (listed_left > 0) --listed_left;
      of_object.push_back(each);
      if (of_object.size() > 2 * kMostVersionsTried) of_object = versions_to_try(std::move(of_object));
      return true;
    });
    if (!has_stopped) {
      look_at_object();
      look_.finished = true;
      look_.after_key.clear();
      if (look_.failed == 0) {
        look_.problem.clear();
      } else {
        failed_at_ = clock_.now();
      }
    }
  } catch (const StoreError& error) {
    if (!error.passes()) failed_at_ = clock_.now();
    list_.set_lock_look(look_);
    throw;
  } catch (...) {
    // By a list that makes no sense nobody knows what was looked at.
    failed_at_ = clock_.now();
    list_.set_lock_look({.retention = retention_});
    throw;
  }
  list_.set_lock_look(look_);
  return look_.lengthened - before;
}

/// The store's own trials are locked for a minute on purpose, and nobody knows what other names are.
bool LockLengthening::is_ours(const std::string& key) const {
  if (!is_plain_key(key)) return false;
  const std::string_view path = std::string_view(key).substr(prefix_.size());
  const std::size_t end = path.find('/');
  if (end == std::string_view::npos) return false;
  const std::string_view first = path.substr(0, end);
  constexpr std::array<std::string_view, 6> kFolders{
      "growing",           "log", "published", archive::kEvidenceFolder, archive::kStoreStatementsFolder,
      search::kStoreFolder};
  return std::ranges::find(kFolders, first) != kFolders.end() || archive::is_case_id(first);
}

/// By the first version that was put: nobody can put one before it, and one that mends it comes later.
UtcTime LockLengthening::end_of(const ListedVersion& first) const {
  if (!first.put) throw Error("the store does not tell when it was put");
  // Nobody can shorten a lock that was set by a wrong time.
  if (*first.put > store_.told_time().value_or(clock_.utc()) + kClocksDiffer)
    throw Error("the store says that it was put on " + format_utc(*first.put) + ", which is yet to come");
  return std::chrono::floor<std::chrono::seconds>(*first.put + retention_);
}

/// Where the first version of a segment is gone, one that mended it came later; the ledger came when the case
/// was closed. Nothing where there is none.
std::optional<UtcTime> LockLengthening::end_of_what_is_sealed(const std::string& case_id) {
  if (sealed_.case_id == case_id) return sealed_.end;
  const std::string key = prefix_ + case_id + "/" + std::string(archive::kLedgerFile);
  std::optional<ListedVersion> first;
  store_.for_each_version(key, [&](const ListedVersion& each) {
    if (each.key == key) first = each;
  });
  const auto end = first ? std::optional(end_of(*first)) : std::nullopt;
  sealed_ = {case_id, end};
  return end;
}

void LockLengthening::look_at(std::vector<ListedVersion> versions, std::uint64_t& most) {
  const std::string key = versions.front().key;
  const std::string_view path = std::string_view(key).substr(prefix_.size());
  const std::string case_id(path.substr(0, path.find('/')));
  try {
    const std::optional<ShippedObject> known = list_.find(key);
    UtcTime until = end_of(versions.back());
    const auto is_known = [&](const ListedVersion& each) { return known && known->version == each.version; };
    std::erase_if(versions, [&](const ListedVersion& each) {
      return is_known(each) && known->lock_ends + kClocksDiffer >= until;
    });
    if (versions.empty()) return;
    if (archive::is_case_id(case_id) && is_for_those_with_keys(path.substr(case_id.size() + 1))) {
      if (const auto end = end_of_what_is_sealed(case_id)) until = std::min(until, *end);
    }
    if (until <= store_.told_time().value_or(clock_.utc())) return;
    for (const ListedVersion& each : versions_to_try(std::move(versions))) {
      if (most > 0) --most;
      guarded(key, [&] { look_at_version(each, is_known(each) ? known : std::nullopt, until); });
    }
  } catch (const StoreError&) {
    throw;
  } catch (const Error& error) {
    fail(key + ": " + error.what());
  }
}

/// What the store refuses of one version keeps no other short.
void LockLengthening::guarded(const std::string& key, const std::function<void()>& work) {
  try {
    work();
  } catch (const StoreError& error) {
    if (error.passes()) throw;
    fail(key + ": " + error.what());
  } catch (const Error& error) {
    fail(key + ": " + error.what());
  }
}

/// `known`: the version that the store had confirmed to be locked.
void LockLengthening::look_at_version(const ListedVersion& version, const std::optional<ShippedObject>& known,
                                      UtcTime until) {
  std::optional<StoredObject> there = store_.look(version.key, version.version);
  if (!there) return;
  ++look_.looked_at;
  if (!there->compliance && !known) return;
  if (!is_locked_until(*there, until - kClocksDiffer)) {
    // In another mode it may be locked for longer.
    if (there->lock_ends) until = std::max(until, *there->lock_ends);
    store_.set_retention(version.key, version.version, until);
    there = store_.look(version.key, version.version);
    if (!there || !is_locked_until(*there, until))
      throw Error(
          "the store took a lock until " + format_utc(until) +
          ", and does not tell of it: its locks cannot be relied on ('kiroku ship --probe' tries them)");
    ++look_.lengthened;
  }
  if (!known) return;
  ShippedObject now = *known;
  now.lock_ends = *there->lock_ends;
  list_.enter(version.key, now);
}

void LockLengthening::fail(const std::string& why) {
  if (look_.failed++ == 0) look_.problem = why;
}

}  // namespace kiroku::fleet
